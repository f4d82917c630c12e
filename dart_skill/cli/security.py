"""`dart-skill security`: the policy of ROS 2 Security for the graph, with the least that each
process needs.
"""

from __future__ import annotations

import argparse
import json
import shlex
from pathlib import Path

from dart_skill.cli.run_options import add_namespace
from dart_skill.common.files import new_file

NEXT = (
    "next: ros2 security create_keystore keystore && ros2 security generate_artifacts -k keystore"
    " -p {path}\nthen: export ROS_SECURITY_KEYSTORE=$PWD/keystore ROS_SECURITY_ENABLE=true"
    " ROS_SECURITY_STRATEGY=Enforce (docs/security.md)"
)


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `security` to the commands of `dart-skill`."""
    text = (
        "write the policy of ROS 2 Security for the graph: what each process may publish, hear,"
        " serve and call"
    )
    parser = commands.add_parser(
        "security", help=text, description=f"{text[0].upper()}{text[1:]}. It needs no ROS."
    )
    parser.add_argument(
        "policy",
        metavar="POLICY",
        type=Path,
        help="the new file, XML, for ros2 security generate_artifacts",
    )
    add_namespace(parser)
    parser.add_argument("--json", action="store_true", help="the file and its enclaves as JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Write the policy.

    Returns
    -------
    int
        The exit status.
    """
    from dart_skill.common.permissions import enclave_of, policy, processes

    with new_file(options.policy) as stream:
        stream.write(policy(options.namespace).encode())
    if options.json:
        print(
            json.dumps(
                {
                    "policy": str(options.policy),
                    "enclaves": [enclave_of(name, options.namespace) for name in processes()],
                }
            )
        )
    else:
        print(
            f"{options.policy}: {len(processes())}"
            f" enclaves\n{NEXT.format(path=shlex.quote(str(options.policy)))}"
        )
    return 0
