"""The cases of `dart-skill experiment faults` as data: what is hurt, how, when, and what the
client is to be told.
"""

from dataclasses import dataclass

from dart_skill_nodes.comms.names import COMMANDS, GUIDING, pose_topic

KILL, FREEZE, HOLD_UP = "kill", "freeze", "hold_up"
"""SIGKILL, and started again; SIGSTOP until the client has its answer; SIGSTOP for HELD_UP
seconds, after which all goes on.
"""
LOSE, DROP, DELAY, DUPLICATE, CORRUPT = "lose", "drop", "delay", "duplicate", "corrupt"
"""Faults of a topic: every message is lost from then on; or one in 20 is lost, late, damaged; or
each comes twice.
"""
FULL_DISK, ATTACK = "full_disk", "attack"
"""A bag's file system is full; a foreign node does what nobody should."""
OF_NODES, OF_TOPICS = (KILL, FREEZE, HOLD_UP), (LOSE, DROP, DELAY, DUPLICATE, CORRUPT)
GARBAGE = "garbage"
"""The attack that sends bytes which are no messages."""
FAULTS = (*OF_NODES, *OF_TOPICS, FULL_DISK, ATTACK)
PHASES = (
    "idle", "lesson", "learning", "planning", "approach", "swing", "motion", "after", "practice", "replay",
)  # fmt: skip
THROW_SKILL = "throw"
"""Skill of the cases that tell no other."""
MOMENTS = {"approach": "approaching", "motion": "executing", "after": "watching"}
"""Phases of a trial of any skill, and what its feedback calls them."""
HELD_UP = 3.0
"""[s, wall clock]"""


@dataclass(frozen=True)
class Case:
    """One fault.

    * what: the node, the short name of a topic, or the name of an attack (`stranger.ATTACKS`).
    * expected: a regular expression that the answer to the client has. goes_on: what the client
      asked for succeeds anyway. skill: that the graph has learned.
    """

    fault: str
    what: str
    phase: str
    expected: str
    goes_on: bool = False
    skill: str = THROW_SKILL

    @property
    def name(self) -> str:
        name = f"{self.fault}_{self.what}_{self.phase}"
        return name if self.skill == THROW_SKILL else f"{self.skill}_{name}"

    @property
    def topic(self) -> str:
        """The topic whose messages get the fault; empty if none do."""
        return TOPICS[self.what][0] if self.fault in OF_TOPICS else ""

    @property
    def node(self) -> str:
        """The node that gets the fault, or whose messages do; empty if it is none in particular."""
        if self.fault in OF_TOPICS:
            return TOPICS[self.what][1]
        return "" if self.fault == ATTACK else self.what


GOES_ON = "^$"
"""The table's word for a client that notices nothing."""
ANY = "^(?!.*took longer)"
"""The table's word for a client that is told anything, success or not, and whenever: it depends on
which message was hurt.
"""
SIMULATOR, COMMANDER, LEARNER, CAMERAS = (
    "wam_simulator",
    "commander",
    "skill_learner",
    "mock_optitrack",
)
DEMONSTRATIONS, TEACHER, COACH, RECORDER, VIEWER = (
    "demonstration_recorder",
    "teacher",
    "coach",
    "recorder",
    "viewer",
)
UNSEEN = "not seen|no cameras"
STALLED = "time has stood still"

TOPICS = {
    "joint_states": ("joint_states", SIMULATOR),
    "command": (COMMANDS, COMMANDER),
    "teacher_wrench": (GUIDING, TEACHER),
    "hand_pose": (pose_topic("hand"), CAMERAS),
    "ball_pose": (pose_topic("ball"), CAMERAS),
    "basket_pose": (pose_topic("basket"), CAMERAS),
}
"""By its short name, a topic and its publisher."""

BYSTANDERS = dict.fromkeys((RECORDER, VIEWER), GOES_ON)
ARM = {name: name for name in (SIMULATOR, COMMANDER)}
THROW = {
    **ARM,
    LEARNER: GOES_ON,
    CAMERAS: UNSEEN,
    DEMONSTRATIONS: DEMONSTRATIONS,
    TEACHER: GOES_ON,
    COACH: GOES_ON,
    **BYSTANDERS,
}
"""Expected reactions during a throw, by the node that fails."""
OF_KILLED: dict[str, dict[str, str]] = {
    "idle": {**THROW, LEARNER: LEARNER, TEACHER: TEACHER, COACH: COACH},
    "lesson": {**THROW, TEACHER: TEACHER},
    "learning": {
        LEARNER: LEARNER,
        **dict.fromkeys((DEMONSTRATIONS, SIMULATOR, COMMANDER), GOES_ON),
    },
    "planning": {**THROW, LEARNER: LEARNER},
    "swing": {**THROW, LEARNER: LEARNER},
    "practice": {**THROW, LEARNER: LEARNER, COACH: COACH},
    "replay": {LEARNER: LEARNER, DEMONSTRATIONS: GOES_ON, "bag_player": GOES_ON},
}
"""What the client is told, by phase and by the node that is killed or frozen in it."""
OF_FROZEN = {("swing", LEARNER): GOES_ON}
"""The same where it is another for a frozen node: a throw is over before it is known that the
learner does not go on.
"""
OF_MESSAGES: dict[str, dict[str, dict[str, str]]] = {
    "swing": {
        "joint_states": {
            LOSE: STALLED,
            DROP: GOES_ON,
            DELAY: GOES_ON,
            DUPLICATE: GOES_ON,
            CORRUPT: ANY,
        },
        "command": {
            LOSE: STALLED,
            DROP: GOES_ON,
            DELAY: GOES_ON,
            DUPLICATE: GOES_ON,
            CORRUPT: ANY,
        },
        "hand_pose": {LOSE: GOES_ON, CORRUPT: GOES_ON},
        "ball_pose": {
            LOSE: UNSEEN,
            DROP: GOES_ON,
            DELAY: GOES_ON,
            DUPLICATE: GOES_ON,
            CORRUPT: GOES_ON,
        },
    },
    "lesson": {
        "joint_states": {LOSE: STALLED, CORRUPT: ANY},
        "command": {LOSE: STALLED},
        "teacher_wrench": {
            LOSE: STALLED,
            DROP: GOES_ON,
            DELAY: GOES_ON,
            DUPLICATE: GOES_ON,
            CORRUPT: ANY,
        },
        "hand_pose": {LOSE: ANY, DROP: GOES_ON, DELAY: GOES_ON, DUPLICATE: GOES_ON, CORRUPT: ANY},
        "ball_pose": {LOSE: ANY},
        "basket_pose": {LOSE: ANY, CORRUPT: ANY},
    },
    "practice": {"ball_pose": {LOSE: ANY}, "hand_pose": {LOSE: ANY}},
}
"""The same by phase, topic, and what becomes of its messages. A ball whose poses are lost is
hidden from the cameras.
"""
OF_FULL_DISKS: dict[str, dict[str, str]] = {
    "lesson": {DEMONSTRATIONS: "recording has stopped", RECORDER: GOES_ON},
    "practice": {DEMONSTRATIONS: "recording has stopped"},
    "swing": {RECORDER: GOES_ON},
}
"""The same by phase and by the node whose bag fills its disk."""
OF_ATTACKS: dict[str, dict[str, str]] = {
    "swing": {
        **dict.fromkeys(
            (
                "strong_commands",
                "future_commands",
                "nan_commands",
                "strong_pushes",
                "poses_before_time",
            ),
            GOES_ON,
        ),
        **dict.fromkeys(
            (
                "poses_beyond_the_world",
                "clock_before_time",
                "parameters",
                "release",
                "second_goal",
                GARBAGE,
            ),
            GOES_ON,
        ),
        "commands_under_its_number": ANY,
        "reversed_states": "publish /joint_states|went back in time",
        "six_joints": "publish /joint_states",
        "stop": "stopped by ~/stop",
        "reset": ANY,
        "guided_reset": ANY,
    },
    "lesson": {
        **dict.fromkeys(
            ("strong_commands", "nan_commands", "strong_pushes", "poses_before_time", GARBAGE),
            GOES_ON,
        ),
        "lesson_at_the_origin": GOES_ON,
        "reversed_states": ANY,
        **dict.fromkeys(("reset", "guided_reset"), "time jumped"),
        "stop": "stopped by /commander/stop",
    },
    "idle": {
        "strong_commands": "publishes /wam/command, too",
        "reversed_states": "publish /joint_states",
        "guided_reset": GOES_ON,
    },
    "practice": {"stop": "stopped"},
}
"""The same by phase, and by what a foreign node does in it."""


OF_A_TRIAL = {
    **ARM,
    LEARNER: ANY,
    CAMERAS: ANY,
    DEMONSTRATIONS: DEMONSTRATIONS,
    **dict.fromkeys((TEACHER, COACH, *BYSTANDERS), GOES_ON),
}
"""What the client is told in a trial of any skill, by the node that fails. A skill that sees what it
does is stopped without cameras; where it does not, nobody sees what comes of it.
"""
OF_SKILLS: dict[str, dict[str, str]] = {
    "lesson": {**OF_A_TRIAL, LEARNER: GOES_ON, TEACHER: TEACHER},
    "learning": OF_KILLED["learning"],
    **dict.fromkeys(MOMENTS, OF_A_TRIAL),
}
"""The same for each phase of the skills that follow."""
SKILLS = ("place", "reach", "darts")
"""Skills whose cases are made from `OF_SKILLS`."""


def _of_skills() -> list[Case]:
    return [
        Case(fault, node, phase, told, told == GOES_ON, skill)
        for skill in SKILLS
        for phase, of in OF_SKILLS.items()
        for node, told in of.items()
        for fault in (KILL, FREEZE)
    ]


def _cases() -> tuple[Case, ...]:
    of_nodes = [
        (what, phase, told) for phase, of in OF_KILLED.items() for what, told in of.items()
    ]
    table = [(KILL, *row) for row in of_nodes] + [
        (FREEZE, what, phase, OF_FROZEN.get((phase, what), told)) for what, phase, told in of_nodes
    ]
    table += [
        (HOLD_UP, node, phase, GOES_ON)
        for phase in ("lesson", "swing")
        for node in OF_KILLED[phase]
    ]
    table += [
        (fault, what, phase, told)
        for phase, of in OF_MESSAGES.items()
        for what, how in of.items()
        for fault, told in how.items()
    ]
    table += [
        (FULL_DISK, node, phase, told)
        for phase, of in OF_FULL_DISKS.items()
        for node, told in of.items()
    ]
    table += [
        (ATTACK, what, phase, told)
        for phase, of in OF_ATTACKS.items()
        for what, told in of.items()
    ]
    of_throws = (
        Case(fault, what, phase, told, told == GOES_ON) for fault, what, phase, told in table
    )
    return (*of_throws, *_of_skills())


CASES = _cases()


def named(*texts: str, skill: str = THROW_SKILL) -> list[Case]:
    """Cases of a skill whose names hold one of these texts, in an order in which little is started
    anew; ValueError for a text that none holds.
    """
    of_skill = [case for case in CASES if case.skill == skill]
    for text in texts:
        if not any(text in case.name for case in of_skill):
            raise ValueError(
                f"no case is called '{text}': dart-skill experiment faults --list names them"
            )
    chosen = [case for case in of_skill if any(text in case.name for text in texts)]
    return sorted(
        chosen,
        key=lambda case: (
            case.phase == "replay",
            case.topic,
            PHASES.index(case.phase),
            FAULTS.index(case.fault),
        ),
    )
