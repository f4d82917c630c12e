"""What each node of the graph may do, as a policy of ROS 2 Security (SROS 2): one enclave for each
process, least privilege.

config/permissions.yaml says it by node. An enclave has the permissions of all nodes of its
process. The policy is what `ros2 security generate_artifacts` takes.
"""

from xml.etree import ElementTree

from dart_skill.common.configuration import config_path, load_yaml
from dart_skill.common.entries import ConfigurationError, Each, Entries, Flag, Rows, Text

FILE = "permissions.yaml"
"""File in config/ that says which node may do what."""
ROOT = "/dart_skill"
"""Enclaves stand below this path: /dart_skill/commander."""
PARAMETERS = (
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "list_parameters",
    "set_parameters",
    "set_parameters_atomically",
)
"""Services of every node's parameters."""
READS = PARAMETERS[:4]
"""Those that change nothing."""
LIFE_CYCLE = (
    "change_state",
    "get_state",
    "get_available_states",
    "get_available_transitions",
    "get_transition_graph",
)
"""Services of a node with a life cycle."""
KINDS = {
    "publishes": ("topic", "publish"),
    "hears": ("topic", "subscribe"),
    "serves": ("service", "reply"),
    "calls": ("service", "request"),
    "executes": ("action", "execute"),
    "commands": ("action", "call"),
}
"""Keys of the file, and what the policy calls them."""
COMMON = {
    "publishes": ("/rosout", "/parameter_events", "/diagnostics", "~/_alive", "~/_pulse"),
    "hears": ("/clock", "/*/_alive"),
    "serves": (
        *(f"~/{name}" for name in PARAMETERS),
        "~/get_type_description",
        "/_*/get_type_description",
    ),
    "calls": ("/*/list_parameters",),
}
"""What every node may do: tell how it is, have parameters, know who lives, and ask whether a
server answers.
"""


NAMES = Rows(Text(filled=True))
SECTION = Entries(
    {},
    {
        **dict.fromkeys((*KINDS, "names", "runs", "asks", "sets"), NAMES),
        "managed": Flag(),
    },
)
"""A section of the file."""
GLOBAL = ("/rosout", "/parameter_events", "/diagnostics", "/tf", "/tf_static")
"""Topics that all graphs of a ROS domain share, whatever their namespaces."""


def enclave_of(process: str, namespace: str = "") -> str:
    """Path of the enclave of a process, as `--enclave` takes it.

    Parameters
    ----------
    process
        Name of its executable.
    namespace
        Of its graph, as "/arm1"; each graph of a domain has enclaves of its own.
    """
    return f"{ROOT}{namespace}/{process}"


def permissions_of(section: str, namespace: str = "") -> dict[str, list[str]]:
    """Everything that a node of config/permissions.yaml may do, by the keys of `KINDS`.

    Parameters
    ----------
    section
        Of the file.
    namespace
        Of the graph, as "/arm1".

    Raises
    ------
    ValueError
        If it has no section there.
    """
    own = _section(section)
    granted = {kind: [*COMMON.get(kind, ()), *own.get(kind, ())] for kind in KINDS}
    if own.get("managed"):
        granted["serves"] += [f"~/{name}" for name in LIFE_CYCLE]
        granted["publishes"].append("~/transition_event")
    granted["calls"] += [f"/{other}/{name}" for other in own.get("asks", ()) for name in READS]
    granted["calls"] += [f"/{other}/set_parameters" for other in own.get("sets", ())]
    return {
        kind: [full for name in names for full in _full_names(name, namespace)]
        for kind, names in granted.items()
    }


def _full_names(name: str, namespace: str) -> tuple[str, ...]:
    """Full names of a name of the file: what is below the node stays so, and everything is that of
    the namespace and what all share.
    """
    if name == "*":
        return (f"{namespace}/*", *GLOBAL) if namespace else ("/*",)
    return (name,) if name.startswith("~") or name in GLOBAL else (f"{namespace}{name}",)


def processes() -> dict[str, list[str]]:
    """The sections of the file that make up each process, by the name of its enclave."""
    return {name: list(one.get("runs", [name])) for name, one in _sections().items()}


def policy(namespace: str = "") -> str:
    """The policy as XML, with an enclave for each process.

    Parameters
    ----------
    namespace
        Of the graph, as "/arm1".
    """
    root = ElementTree.Element("policy", version="0.2.0")
    inside = ElementTree.SubElement(root, "enclaves")
    for enclave, sections in processes().items():
        profiles = ElementTree.SubElement(
            ElementTree.SubElement(inside, "enclave", path=enclave_of(enclave, namespace)),
            "profiles",
        )
        for section in sections:
            for node in _section(section).get("names", [section]):
                _add_profile(profiles, node, namespace or "/", permissions_of(section, namespace))
    ElementTree.indent(root)
    return (
        '<?xml version="1.0"'
        f' encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'
    )


def _sections() -> dict:
    """What the file says; ConfigurationError where it is not as it must be."""
    content, path = load_yaml(FILE), config_path(FILE)
    Each(SECTION).check(content, str(path))
    for name, section in content.items():
        if unknown := sorted(set(section.get("runs", ())) - set(content)):
            raise ConfigurationError(
                f"{path}: {name}.runs has {', '.join(unknown)}, of which there is no section"
            )
    return content


def _section(name: str) -> dict:
    sections = _sections()
    if name not in sections:
        raise ValueError(f"{FILE} has no section '{name}', only {sorted(sections)}")
    return sections[name]


def _add_profile(
    profiles: ElementTree.Element, node: str, space: str, permissions: dict[str, list[str]]
) -> None:
    profile = ElementTree.SubElement(profiles, "profile", ns=space, node=node)
    for kind, names in permissions.items():
        what, rule = KINDS[kind]
        if names:
            expressions = ElementTree.SubElement(profile, f"{what}s", {rule: "ALLOW"})
            for name in names:
                ElementTree.SubElement(expressions, what).text = name
