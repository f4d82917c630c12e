"""What came of the cases: judged, as a table for docs/faults.md, and as JSON."""

import re
from dataclasses import asdict, dataclass

from dart_skill_nodes.verbs.faults.cases import Case

ANSWERED = 5.0
"""Every client has its answer within so long of the fault [s, wall clock]."""
FASTEST = 1.1
"""After a fault the arm is at most so much faster than without one."""
AT_REST = 0.1
"""Joint speed at which an arm is held [rad/s]."""


@dataclass(frozen=True)
class Reaction:
    """Of the graph to one case.

    * answer, seconds: what the client was told, and how long after the fault [s, wall clock].
    * fastest, strongest: of all joints after the fault [rad/s], [N m]; last: speed of the fastest joint when the watching ended.
    * pushed: who sent commands that push after the fault.
    * bag: what is wrong with the bag of a recorder that was killed, empty if nothing is.
    * afterwards: why the graph does not work again with only the faulty node started again, empty if it does; within [s, wall clock].
    """

    case: Case
    succeeded: bool
    answer: str
    seconds: float
    fastest: float
    strongest: float
    last: float
    pushed: tuple[str, ...]
    bag: str
    afterwards: str
    within: float

    def faults(self, usual: tuple[float, float], answered: float = ANSWERED) -> list[str]:
        """What is not as it must be, in words.

        usual: speed of the joints in throws and lessons without a fault [rad/s], and the most that a motor gives [N m].
        answered: longest wait for an answer [s].
        """
        wrong = []
        if self.case.goes_on and not self.succeeded:
            wrong.append("the client noticed it")
        if not self.case.goes_on:
            if self.seconds > answered:
                wrong.append(f"answered after {self.seconds:.1f} s")
            if not re.search(self.case.expected, self.answer):
                wrong.append(f"the answer does not name the cause: {self.case.expected}")
        for what, value, most in (
            (f"{self.fastest:.1f} rad/s", self.fastest, FASTEST * usual[0]),
            (f"{self.strongest:.0f} Nm", self.strongest, usual[1]),
        ):
            if value > most:
                wrong.append(what)
        if self.last > AT_REST:
            wrong.append(f"the arm still moves at {self.last:.2f} rad/s")
        return wrong + [text for text in (self.bag, self.afterwards) if text]


def as_json(reaction: Reaction, usual: tuple[float, float]) -> dict:
    """One line of --json."""
    return {"name": reaction.case.name, **asdict(reaction), "wrong": reaction.faults(usual)}


HEAD = """# When a node dies or freezes

`dart-skill experiment faults` starts the real graph. In each case it kills or freezes one node, and looks at what the
client is told, at the arm, at the bag, and at whether all works again when only that node was started again. This
page is what it writes.

    dart-skill experiment faults --list
    dart-skill experiment faults --case kill_commander_swing
    dart-skill experiment faults --page docs/faults.md

* **kill**: SIGKILL; then the node is started again.
* **freeze**: SIGSTOP until the client has its answer; then SIGCONT.
* **hold_up**: SIGSTOP for 3 s; what was asked for goes on.

A client must be told within 5 s of the wall clock. A dead process is known by DDS: threads of the middleware say that
it is there, whatever its Python code is busy with, and 4 s after their last word it is taken for dead.
"""


def page(reactions: list[Reaction], usual: tuple[float, float]) -> str:
    """docs/faults.md."""
    good = sum(not reaction.faults(usual) for reaction in reactions)
    lines = [
        HEAD,
        f"{good} of {len(reactions)} cases are as they must be. In throws and lessons without a fault the fastest joint",
        f"makes {usual[0]:.1f} rad/s, and the strongest motor has {usual[1]:.0f} Nm.",
        "",
        "| case | the client is told | after s | rad/s | Nm | works again | |",
        "|---|---|---|---|---|---|---|",
    ]
    for one in reactions:
        wrong = "; ".join(one.faults(usual))
        again = "no" if one.afterwards else f"after {one.within:.0f} s"
        told = " ".join(one.answer.split()).replace("|", "/")
        speed = f"{one.fastest:.1f} | {one.strongest:.0f}"
        lines.append(f"| {one.case.name} | {told} | {one.seconds:.1f} | {speed} | {again} | {wrong or 'ok'} |")
    return "\n".join(lines) + "\n"
