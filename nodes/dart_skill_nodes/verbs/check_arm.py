"""`dart-skill check arm`: listens to the arm and its cameras, and says line by line whether
anything may move.
"""

import argparse
import json
import math
import select
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import add_namespace, chosen_skill, remapping
from dart_skill.common.world import the_world
from dart_skill_nodes.comms.names import CLOCK, COMMANDS, JOINT_STATES, pose_topics, remapped
from dart_skill_nodes.process.environment import Interrupts, stay_on_this_machine
from dart_skill_nodes.verbs.on_graph import say

if TYPE_CHECKING:
    import numpy as np

    from dart_skill.arm.check import ArmReport, Heard, PostureCounter

USUAL = 10.0
"""Time of listening where none is given, and no terminal is there to press Enter at [s]."""
PATIENCE = 10.0
"""For joint states, which a simulation that is paused does not give [s]."""
TAKE = 0.02
"""Messages are taken so often [s]."""
NEXT = "next: dart-skill teach --count 5 (docs/hardware.md)"
MEND = "next: mend what says NO-GO, and check again: dart-skill check arm"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "Listens to the arm and its cameras, and moves nothing. Meanwhile lead the released arm"
        " slowly through postures, each with the hand turned otherwise. Exit status 0 if no line"
        " says NO-GO, else 1."
    )
    parser.add_argument(
        "--skill",
        metavar="NAME",
        help="whose bodies the cameras must see (default: that of config/world.yaml)",
    )
    parser.add_argument(
        "--postures",
        type=int,
        metavar="N",
        help="listen until the arm has rested in so many different postures",
    )
    parser.add_argument(
        "--duration",
        type=float,
        metavar="S",
        help=f"listen for so long [s] (default: until Enter, or {USUAL:.0f} s)",
    )
    parser.add_argument(
        "--write",
        type=Path,
        metavar="FILE",
        help="write the registration of cameras and arm, for registration_file",
    )
    parser.add_argument(
        "--remap",
        nargs="+",
        type=remapping,
        default=[],
        metavar="OLD:=NEW",
        help="a topic, or all that begin so, have another name: /vrpn_mocap:=/mocap",
    )
    add_namespace(parser)
    parser.add_argument("--json", action="store_true", help="the lines as JSON")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Listen and judge; returns the exit status."""
    _refuse_what_cannot_be(options, parser)
    stay_on_this_machine()
    from dart_skill.arm import save_registration
    from dart_skill.arm.check import check_arm
    from dart_skill.recording import HAND

    skill = chosen_skill(parser, options.skill or the_world().skill)
    remappings = _remappings(options, parser, (HAND, *skill.bodies))
    heard = listen(options, (HAND, *skill.bodies), remappings)
    report = check_arm(replace(heard, in_hand=skill.in_hand))
    written = options.write is not None and report.registration is not None
    if written:
        save_registration(options.write, report.registration)
    print(
        _as_json(report, options.write if written else None)
        if options.json
        else _as_text(report, options.write if written else None)
    )
    if options.write and not written:
        say(
            f"dart-skill: {options.write} was not written: the lines 'hand against kinematics' and"
            " 'postures' must be go"
        )
        return 1
    return 0 if report.is_go else 1


def _refuse_what_cannot_be(options: argparse.Namespace, parser: argparse.ArgumentParser) -> None:
    if options.postures is not None and options.postures < 1:
        parser.error(f"--postures is {options.postures}; it must be at least 1")
    if options.duration is not None and not (0.0 < options.duration < math.inf):
        parser.error(f"--duration is {options.duration}; it must be positive and finite")
    if options.write is not None and options.write.exists():
        parser.error(f"--write {options.write}: the file exists already: name another one")
    if options.write is not None and not options.write.resolve().parent.is_dir():
        parser.error(
            f"--write {options.write}: there is no folder {options.write.resolve().parent}"
        )


def _remappings(
    options: argparse.Namespace, parser: argparse.ArgumentParser, roles: Iterable[str]
) -> dict[str, str]:
    """What topics are called instead, by name; a usage error names what is none."""
    topics = (JOINT_STATES, COMMANDS, CLOCK, *pose_topics(roles).values())
    try:
        return remapped(topics, dict(one.split("=", 1) for one in options.remap))
    except ValueError as error:
        parser.error(f"--remap {error}")


def listen(
    options: argparse.Namespace, roles: Iterable[str], remappings: Mapping[str, str]
) -> "Heard":
    """Everything that was heard of joints and bodies until the options say that it is enough, or Ctrl-C."""
    interrupts = Interrupts()  # before the imports, in which an interrupt may get lost
    from dart_skill_nodes.client.arm_listener import ArmListener
    from dart_skill_nodes.process.node_base import node_of_command

    with node_of_command("arm_check", options.namespace, remappings) as (node, spin):
        listener = ArmListener(node, roles)
        _listen(options, listener, interrupts, lambda: spin(TAKE))
        heard = listener.heard()
        listener.close()
        return heard


def _listen(
    options: argparse.Namespace, listener, interrupts: Interrupts, spin: Callable[[], None]
) -> None:
    from dart_skill.arm.check import PostureCounter

    counter, begun = PostureCounter(), time.monotonic()
    last, told, drivers = begun, False, []
    until_enter = (
        options.postures is None
        and options.duration is None
        and sys.stdin is not None
        and sys.stdin.isatty()
    )
    longest = options.duration or (
        math.inf if until_enter or options.postures is not None else USUAL
    )
    say(
        f"listening{': lead the arm slowly through postures, and press Enter' if until_enter else ''}"
    )
    while time.monotonic() - begun < longest and not interrupts:
        spin()
        state = listener.take()
        last = last if state is None else time.monotonic()
        if not told and not listener.silent:
            told = True
            say("arm and cameras are heard")
        before, drivers = drivers, listener.drivers
        if before != drivers and max(len(before), len(drivers)) > 1:
            say(f"/joint_states: {len(drivers)} publishers: {', '.join(drivers)}")
        if state is not None and counts(counter, *state):
            say(f"posture {len(counter)}{f' of {options.postures}' if options.postures else ''}")
        if options.postures is not None and len(counter) >= options.postures:
            return
        if until_enter and select.select([sys.stdin], [], [], 0.0)[0]:
            return
        if time.monotonic() - last > PATIENCE and not (listener.hears_joints and until_enter):
            say(f"no /joint_states for {PATIENCE:.0f} s")
            return


def counts(counter: "PostureCounter", time: float, position: "np.ndarray") -> bool:
    """Whether joints at an instant [s] make a new posture; what is no posture of the arm makes none."""
    import numpy as np

    from dart_skill.common.arm_choice import joint_count

    return (
        position.shape == (joint_count(),)
        and bool(np.isfinite(position).all())
        and counter.add(time, position)
    )


def _as_json(report: "ArmReport", written: Path | None) -> str:
    lines = [asdict(one) | {"verdict": one.verdict.value} for one in report.lines]
    fit = report.registration
    found = (
        None
        if fit is None
        else {
            **asdict(fit.registration),
            "spread": fit.spread.tolist(),
            "sightings": fit.n_sightings,
        }
    )
    if found is not None:
        found |= {
            "position_error": fit.position_error,
            "angle_error": fit.angle_error,
            "condition": fit.condition,
        }
    return json.dumps(
        {
            "go": report.is_go,
            "lines": lines,
            "registration": found,
            "written": None if written is None else str(written),
        }
    )


def _as_text(report: "ArmReport", written: Path | None) -> str:
    from dart_skill.arm.check import as_text

    told = [as_text(report, shutil.get_terminal_size().columns)]
    if written:
        told.append(f"registration: {written}")
        told.append("give it to skill_learner and commander as registration_file")
    return "\n".join([*told, NEXT if report.is_go else MEND])
