"""Lessons and trials of any skill on a graph, as the verbs carry them out and tell of them; own
darts, and a leg of 501 by the best policy for the spread that came of them.

The library is imported when something runs: parsers must come at once.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from dart_skill_nodes.process.graph_processes import GraphFailure
from dart_skill_nodes.verbs.on_graph import say

if TYPE_CHECKING:
    from dart_skill_msgs.action import Practice
    from dart_skill_msgs.msg import Outcome

    from dart_skill.common.situation import Situation
    from dart_skill.darts import ModelBasedAgent
    from dart_skill.session import Dart, DartsRun, Hit, TrialResult
    from dart_skill.skills.protocol import Skill, SkillWords
    from dart_skill_nodes.client.graph_client import GraphClient

EXECUTED = "executed"
"""Message of a trial of which there is nothing to say."""


def show_all(
    client: "GraphClient", skill: "Skill", lessons: "Iterator[Situation]", wanted: int
) -> int:
    """Lessons until `wanted` movements were shown, in new situations for those that failed; how
    many attempts it took.
    """
    from dart_skill_nodes.comms import conversions

    shown = attempts = 0
    for _ in range(2 * wanted):
        situation = next(lessons)
        result = client.show(conversions.situation_msg(situation))
        attempts += result.attempts
        shown += bool(result.success)
        where, how = skill.in_words(situation), how_it_went(skill, result)
        say(f"demonstration {shown}/{wanted}: {where}: {how}")
        if shown == wanted:
            return attempts
    raise GraphFailure(f"only {shown} of {wanted} demonstrations succeeded")


def teach(client: "GraphClient", seed: int, wanted: int) -> int:
    """Lessons of throwing at the baskets of a seed; how many throws it took."""
    from dart_skill.common.world import THROW
    from dart_skill.skills.protocol import load_skill

    skill = load_skill(THROW)
    return show_all(client, skill, skill.situations(seed, wanted, 0)[0], wanted)


def how_it_went(skill: "Skill", lesson: Any) -> str:
    """What became of a lesson."""
    if lesson.success:
        return f"{skill.words.lesson} after {lesson.attempts}"
    return f"given up: {lesson.message}"


def teach_by_hand(client: "GraphClient", wanted: int, words: "SkillWords") -> int:
    """Movements that a person guides on a real arm, told by the Enter key, until enough can be
    learned from; how many that are.

    words: of the skill.
    """
    say("the arm is free now: guide it by hand. Ctrl-D ends the lesson")
    client.release_arm(True)
    shown = 0
    try:
        while shown < wanted:
            _ask(words.begin)
            client.start_demonstration()
            _ask(words.show)
            stopped = client.stop_demonstration()
            shown += bool(stopped.success and stopped.readable)
            what = f"{stopped.demonstration.id} is kept" if stopped.success else "not kept"
            say(f"demonstration {shown}/{wanted}: {stopped.message or what}")
    except EOFError:
        say("the lesson ends")
    say("the arm is held where it is from now on")
    client.release_arm(False)
    return shown


def _ask(text: str) -> None:
    """Wait for the Enter key; EOFError if there is no more input."""
    say(text)
    input()


def try_all(
    client: "GraphClient", skill: "Skill", situations: "Iterable[Situation]", count: int
) -> list["TrialResult"]:
    """One trial in each situation, from a world that is reset. count: how many there are."""
    from dart_skill_msgs.action import Execute

    from dart_skill_nodes.comms import conversions

    results = []
    for number, situation in enumerate(situations, start=1):
        made = client.execute(conversions.situation_msg(situation), skill.looks)
        result = trial_result(skill, made.outcome, made.message)
        refused = made.code == Execute.Goal.OUTCOME_REFUSED
        became = f"no {_one(skill)}: {result.message}" if refused else result.in_words(skill.words)
        say(f"{skill.name} {number}/{count}: {skill.in_words(situation)}: {became}")
        results.append(result)
    return results


def throw_at(client: "GraphClient", targets: "Iterable[Any]") -> list["TrialResult"]:
    """One throw at each basket (3,) [m]."""
    from dart_skill.common.world import THROW
    from dart_skill.skills.protocol import load_skill

    skill, targets = load_skill(THROW), list(targets)
    return try_all(client, skill, map(skill.at, targets), len(targets))


def trial_result(skill: "Skill", outcome: "Outcome", message: str) -> "TrialResult":
    """What the cameras saw of a trial, and what there is to say of it."""
    from dart_skill.session import TrialResult
    from dart_skill_nodes.comms import conversions

    message = "" if message == EXECUTED else message
    if skill.told_by == "landings":
        seen = bool(outcome.seen)
        landing = conversions.seen_at(outcome, conversions.LANDING) if seen else None
        error = float(outcome.error) if seen else None
        target = conversions.target_of(outcome.situation)
        return TrialResult.of_throw(target, landing, error, outcome.success, message)
    situation = conversions.situation(outcome.situation)
    return TrialResult(situation, conversions.task_outcome(outcome), message)


def practise(
    client: "GraphClient",
    skill: "Skill",
    trials: int,
    what: str = "",
    before: int = 0,
    **where: Any,
) -> tuple["Practice.Result", list["TrialResult"]]:
    """Own trials, each learned from unless it is only executed: what the coach says, and what
    became of each; a line is said for each, and what a person should do.

    Parameters:

    * what: a trial is called.
    * before: trials of earlier goals.
    * where: as of `GraphClient.practise`; by default the coach chooses.
    """
    messages: dict[int, str] = {}
    what = what or _one(skill)

    def tell(feedback: Any) -> None:
        name = f"{what} {before + feedback.number}"
        if feedback.phase == "waiting":
            say(f"{name}: {feedback.message}")
        if feedback.phase == "done":
            messages[feedback.number] = feedback.message
            said = feedback.message.removeprefix(EXECUTED)
            result = trial_result(skill, feedback.outcome, said)
            say(f"{name}: {skill.in_words(result.situation)}: {result.in_words(skill.words)}")

    result = client.practise(trials, **where, on_feedback=tell)
    made = [
        trial_result(skill, outcome, messages.get(number, ""))
        for number, outcome in enumerate(result.outcomes, start=1)
    ]
    return result, made


def _one(skill: "Skill") -> str:
    """What one trial is called."""
    return skill.words.trials.removesuffix("s")


# darts


def practise_darts(
    client: "GraphClient", skill: Any, seed: int, throws: int
) -> tuple[list["TrialResult"], "DartsRun"]:
    """Own darts, each of which is learned from, and a leg."""
    from dart_skill.session import DartsRun, play_leg

    result, darts, agent = own_darts(client, skill, throws)
    say(result.message)
    trials = [
        trial_result(skill, outcome, dart.note)
        for outcome, dart in zip(result.outcomes, darts, strict=True)
    ]
    leg = play_leg(agent, partial(throw_dart, client, skill), say)
    return trials, DartsRun(seed, "of the graph", skill.middle, (), tuple(darts), leg)


def own_darts(
    client: "GraphClient", skill: Any, throws: int
) -> tuple["Practice.Result", list["Dart"], "ModelBasedAgent"]:
    """Own darts whose aims the coach chooses: what it says of them, the darts, and an agent that
    knows as much of the thrower as that of the coach.
    """
    from dart_skill.darts import place_of
    from dart_skill_nodes.comms import conversions

    messages: dict[int, str] = {}

    def tell(feedback: Any) -> None:
        if feedback.phase == "done":
            messages[feedback.number] = feedback.message
            aimed = conversions.aimed(feedback.outcome.situation, skill)
            at, error = place_of(skill.aim(aimed)), feedback.outcome.error
            off = f"{1e3 * error:.0f} mm off" if math.isfinite(error) else "not seen"
            say(f"dart {feedback.number} at {at}: {off}; {feedback.message}")

    result, agent = client.practise(throws, on_feedback=tell), skill.agent()
    darts = [
        _dart(skill, agent, outcome, messages.get(number, ""))
        for number, outcome in enumerate(result.outcomes, start=1)
    ]
    return result, darts, agent


def _dart(skill: Any, agent: "ModelBasedAgent", outcome: "Outcome", message: str) -> "Dart":
    """A dart as its outcome tells of it; the agent learns from it."""
    from dart_skill.session import Dart
    from dart_skill_nodes.comms import conversions

    dart = Dart.aimed_by(agent)
    if not conversions.stamp_ns(outcome.header.stamp):
        agent.cannot()
    if not outcome.seen:
        return replace(dart, note=message or "the cameras did not see where the dart went")
    hit = skill.face.on_board(conversions.seen_at(outcome, conversions.LANDING))
    agent.tell(hit)
    return dart.seen_at(hit)


def throw_dart(client: "GraphClient", skill: Any, aim: Any) -> "Hit":
    """One dart of the graph at a point (2,) [mm] of the board, which is learned from."""
    from dart_skill.session import Hit
    from dart_skill_nodes.comms import conversions

    made = client.practise(situations=[conversions.situation_msg(skill.aimed(aim))])
    if made.outcomes and made.outcomes[0].seen:
        return Hit(skill.face.on_board(conversions.seen_at(made.outcomes[0], conversions.LANDING)))
    return Hit(
        None, "the cameras did not see where the dart went" if made.success else made.message
    )
