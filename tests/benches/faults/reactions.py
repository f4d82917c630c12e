"""What came of the cases: judged, as a table for docs/faults.md, and as JSON."""

import re
from dataclasses import asdict, dataclass

from tests.benches.faults.cases import ANY, CASES, FAULTS, Case

ANSWERED = 5.0
"""Every client has its answer within so long of the fault [s, wall clock]."""
FASTEST = 1.1
"""After a fault the arm is at most so much faster than without one."""
AT_REST = 0.1
"""Joint speed at which an arm is held [rad/s]."""


@dataclass(frozen=True)
class Reaction:
    """Reaction of the graph to one case.

    * answer, seconds: what the client was told, and how long after the fault, or after the end of
      a motion that was carried out in spite of it [s, wall clock].
    * fastest, strongest: of the joints before the wrist, and of all that are driven, not braked,
      after the fault [rad/s], [N m]; last: of all when the watching ended.
    * pushed: who sent commands that push after the fault; at_once: whether commander and teacher
      did so in one step.
    * bag: what is wrong with the bag of a recorder that was killed, empty if nothing is.
    * afterwards: why the graph does not work again with only the faulty node started again, empty
      if it does; within [s, wall clock].
    """

    case: Case
    succeeded: bool
    answer: str
    seconds: float
    fastest: float
    strongest: float
    last: float
    pushed: tuple[str, ...]
    at_once: bool
    bag: str
    afterwards: str
    within: float

    def faults(self, usual: tuple[float, float], answered: float = ANSWERED) -> list[str]:
        """What is not as it must be, in words.

        usual: speed of the joints in throws and lessons without a fault [rad/s], and the most that
        a motor gives [N m]. answered: longest wait for an answer [s].
        """
        wrong = self._wrong_answer(answered)
        for what, value, most in (
            (f"{self.fastest:.1f} rad/s", self.fastest, FASTEST * usual[0]),
            (f"{self.strongest:.0f} Nm", self.strongest, usual[1]),
        ):
            if value > most:
                wrong.append(what)
        if self.last > AT_REST:
            wrong.append(f"the arm still moves at {self.last:.2f} rad/s")
        if self.at_once:
            wrong.append("commander and teacher pushed at once")
        return wrong + [text for text in (self.bag, self.afterwards) if text]

    def _wrong_answer(self, answered: float) -> list[str]:
        if self.case.goes_on:
            return [] if self.succeeded else ["the client noticed it"]
        # else nobody knows which of the messages did it
        known = not self.succeeded and self.case.expected != ANY
        late = (
            [f"answered after {self.seconds:.1f} s"] if known and self.seconds > answered else []
        )
        named = re.search(self.case.expected, self.answer)
        return late + (
            [] if named else [f"the answer does not name the cause: {self.case.expected}"]
        )


def as_json(reaction: Reaction, usual: tuple[float, float]) -> dict:
    """One line of --json."""
    return {"name": reaction.case.name, **asdict(reaction), "wrong": reaction.faults(usual)}


HEAD = """# When things go wrong

`dart-skill experiment faults` starts the real graph, every node a process, and in each case hurts it in one place at
one moment. It looks at what the client is told, at the arm, at the bag, and at whether all works again when only the
faulty part was started again. This page is what it writes.

    dart-skill experiment faults --list
    dart-skill experiment faults --case kill_commander_swing
    dart-skill experiment faults --page docs/faults.md

There are cases of `place`, `reach` and `darts`, too: each node of the graph is killed and frozen while the skill is
taught and learned, on the approach, in the motion, and while it is watched what came of it. This page has none of them:

    dart-skill experiment faults --skill place --list

| skill | cases that were tried | not tried yet |
|---|---|---|
| `darts` | motion 18, approach 18, learning 8, lesson 2 | lesson 16, after 18 |
| `place` | motion 18, learning 8 | lesson 18, approach 18, after 18 |
| `reach` | motion 18 | lesson 18, learning 8, approach 18, after 18 |

They were tried at a load of 9 to 14 on two cores, and what was not as it must be again on idle ones. Then all was as it
must be, but for one thing: four of twelve times in which a node was frozen for 15 s and more, while a part was placed,
the middleware did not find it again within two minutes, twice on idle cores. Which one it is differs from try to
try, and the reason is not known. Start such a node again.

A client must be told within 5 s of the wall clock, or within 5 s of the end of a motion that does not need what failed.
On the same machine the system says whether a process has died, and
it is known within 0.2 s. One that is stopped may go on within 3.5 s. A process of another machine is taken for dead 4 s
after the last word of its middleware, whatever its Python code is busy with. Time that stands still, though nobody
holds it, is noticed after 4.4 s. Where it depends on which message was hurt, the client must be told, but not within a
time.

Speed and torque are those of the fastest joint before the wrist, and of the joint that is driven hardest, after the
fault, from the ground truth of the simulator. Shorted motors brake with more than they drive with.
Under `pushed` stands who sent commands that push; those of a stranger are not obeyed.
"""
MEANING = {
    "kill": "SIGKILL; then the node is started again.",
    "freeze": "SIGSTOP until the client has its answer; then SIGCONT.",
    "hold_up": "SIGSTOP for 3 s; what was asked for goes on.",
    "lose": (
        "From then on every message of a topic is lost. A ball whose poses are lost is hidden from"
        " the cameras."
    ),
    "drop": "One message in twenty is lost.",
    "delay": "One message in twenty comes 0.3 s later than the others.",
    "duplicate": "Every message comes twice.",
    "corrupt": "Of one message in twenty some bytes are changed, or its end is cut off.",
    "full_disk": (
        "The disk to which a node writes its bag is full. It is a file system of its own, in"
        " memory."
    ),
    "attack": "A foreign node does what nobody should: `stranger.py` says how.",
}
"""What is done in the cases."""


def page(reactions: list[Reaction], usual: tuple[float, float]) -> str:
    """docs/faults.md."""
    good = sum(not reaction.faults(usual) for reaction in reactions)
    lines = [
        HEAD,
        (
            f"{good} of {len(reactions)} cases are as they must be. In throws and lessons without"
            " a fault the fastest joint"
        ),
        (
            f"before the wrist makes {usual[0]:.1f} rad/s, and the strongest motor has"
            f" {usual[1]:.0f} Nm."
        ),
    ]
    skills = {one.case.skill for one in reactions}
    of_skills = sum(case.skill in skills for case in CASES)
    if len(reactions) < of_skills:
        lines += ["", f"Only these {len(reactions)} of the {of_skills} cases were tried."]
    for fault in FAULTS:
        if of_fault := [one for one in reactions if one.case.fault == fault]:
            lines += ["", f"## {fault}", "", MEANING[fault], "", *_table(of_fault, usual)]
    return "\n".join(lines) + "\n"


def _table(reactions: list[Reaction], usual: tuple[float, float]) -> list[str]:
    rows = [
        "| case | the client is told | after s | rad/s | Nm | pushed | works again | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for one in reactions:
        wrong = "; ".join(one.faults(usual))
        again = "no" if one.afterwards else f"after {one.within:.0f} s"
        told = " ".join(one.answer.split()).replace("|", "/")
        moved = f"{one.fastest:.1f} | {one.strongest:.0f} | {', '.join(one.pushed)}"
        rows.append(
            f"| {one.case.name} | {told} | {one.seconds:.1f} | {moved} | {again} |"
            f" {wrong or 'ok'} |"
        )
    return rows
