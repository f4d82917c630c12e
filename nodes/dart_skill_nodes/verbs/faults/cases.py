"""The cases of `dart-skill experiment faults` as data: which node, what happens to it, when, and what the client is to be told."""

from dataclasses import dataclass

KILL, FREEZE, HOLD_UP = "kill", "freeze", "hold_up"
"""SIGKILL, and started again; SIGSTOP until the client has its answer; SIGSTOP for HELD_UP seconds, after which all goes on."""
FAULTS = (KILL, FREEZE, HOLD_UP)
PHASES = ("idle", "lesson", "learning", "planning", "swing", "practice", "replay")
HELD_UP = 3.0
"""[s, wall clock]"""


@dataclass(frozen=True)
class Case:
    """One fault. expected: a regular expression that the answer to the client has; goes_on: what the client asked for succeeds anyway."""

    fault: str
    node: str
    phase: str
    expected: str
    goes_on: bool = False

    @property
    def name(self) -> str:
        return f"{self.fault}_{self.node}_{self.phase}"


GOES_ON = "^$"
"""The table's word for a client that notices nothing."""
SIMULATOR, COMMANDER, LEARNER, CAMERAS = "wam_simulator", "commander", "skill_learner", "mock_optitrack"
DEMONSTRATIONS, TEACHER, COACH, RECORDER, VIEWER = "demonstration_recorder", "teacher", "coach", "recorder", "viewer"
UNSEEN = "not seen|no cameras"

EXPECTED: dict[str, dict[str, str]] = {
    "idle": {
        SIMULATOR: SIMULATOR,
        COMMANDER: COMMANDER,
        LEARNER: LEARNER,
        CAMERAS: "no cameras",
        DEMONSTRATIONS: DEMONSTRATIONS,
        TEACHER: TEACHER,
        COACH: COACH,
        RECORDER: GOES_ON,
        VIEWER: GOES_ON,
    },
    "lesson": {
        SIMULATOR: SIMULATOR,
        COMMANDER: COMMANDER,
        LEARNER: GOES_ON,
        CAMERAS: UNSEEN,
        DEMONSTRATIONS: DEMONSTRATIONS,
        TEACHER: TEACHER,
        COACH: GOES_ON,
        RECORDER: GOES_ON,
        VIEWER: GOES_ON,
    },
    "learning": {LEARNER: LEARNER, DEMONSTRATIONS: GOES_ON, SIMULATOR: GOES_ON, COMMANDER: GOES_ON},
    "planning": {
        SIMULATOR: SIMULATOR,
        COMMANDER: COMMANDER,
        LEARNER: LEARNER,
        CAMERAS: UNSEEN,
        DEMONSTRATIONS: DEMONSTRATIONS,
        TEACHER: GOES_ON,
        COACH: GOES_ON,
        RECORDER: GOES_ON,
        VIEWER: GOES_ON,
    },
    "swing": {
        SIMULATOR: SIMULATOR,
        COMMANDER: COMMANDER,
        LEARNER: GOES_ON,
        CAMERAS: UNSEEN,
        DEMONSTRATIONS: DEMONSTRATIONS,
        TEACHER: GOES_ON,
        COACH: GOES_ON,
        RECORDER: GOES_ON,
        VIEWER: GOES_ON,
    },
    "practice": {
        SIMULATOR: SIMULATOR,
        COMMANDER: COMMANDER,
        LEARNER: LEARNER,
        CAMERAS: UNSEEN,
        DEMONSTRATIONS: DEMONSTRATIONS,
        TEACHER: GOES_ON,
        COACH: COACH,
        RECORDER: GOES_ON,
        VIEWER: GOES_ON,
    },
    "replay": {LEARNER: LEARNER, DEMONSTRATIONS: GOES_ON, "bag_player": GOES_ON},
}
"""What the client is told, by phase and by the node that is killed or frozen in it."""


def _cases() -> tuple[Case, ...]:
    fatal = [
        Case(fault, node, phase, expected, expected == GOES_ON)
        for phase, nodes in EXPECTED.items()
        for node, expected in nodes.items()
        for fault in (KILL, FREEZE)
    ]
    held = [Case(HOLD_UP, node, phase, GOES_ON, True) for phase in ("lesson", "swing") for node in EXPECTED[phase]]
    return (*fatal, *held)


CASES = _cases()


def named(pattern: str | None) -> list[Case]:
    """Cases whose names hold a text, all of them without one; ValueError if there is none."""
    chosen = [case for case in CASES if pattern is None or pattern in case.name]
    if not chosen:
        raise ValueError(f"no case is called '{pattern}': dart-skill experiment faults --list names them")
    return sorted(chosen, key=lambda case: (case.phase == "replay", PHASES.index(case.phase), FAULTS.index(case.fault)))
