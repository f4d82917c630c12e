"""Lessons and trials of any skill on a graph: what verbs do with `--skill`."""

import math
from functools import partial
from typing import TYPE_CHECKING

from dart_skill_nodes.client.failures import GraphFailure
from dart_skill_nodes.verbs._run import say

if TYPE_CHECKING:
    import numpy as np
    from dart_skill_msgs.action import Practice

    from dart_skill.session import SkillResult
    from dart_skill.skills.protocol import Situation, Skill
    from dart_skill_nodes.client.graph_client import GraphClient


def drawn(seed: int) -> "np.random.Generator":
    """Random numbers of the situations of a seed: those in which it is shown come first."""
    import numpy as np

    return np.random.default_rng([seed, 7])


def show_all(
    client: "GraphClient", skill: "Skill", wanted: int, rng: "np.random.Generator"
) -> int:
    """Lessons until so many movements were shown, in new situations for those that failed; how
    many attempts it took.
    """
    from dart_skill.session import in_words
    from dart_skill_nodes.comms import conversions

    shown = attempts = 0
    drawn = skill.draws(rng, wanted)
    for lesson in range(2 * wanted):
        situation = drawn[lesson] if lesson < wanted else skill.draw(rng)
        result = client.show(conversions.situation_msg(situation))
        attempts += result.attempts
        shown += bool(result.success)
        how = f"shown after {result.attempts}" if result.success else f"given up: {result.message}"
        say(f"demonstration {shown}/{wanted}: {in_words(situation, units=skill.units)}: {how}")
        if shown == wanted:
            return attempts
    raise GraphFailure(f"only {shown} of {wanted} demonstrations succeeded")


def execute_all(
    client: "GraphClient", skill: "Skill", trials: int, rng: "np.random.Generator"
) -> list["SkillResult"]:
    """One trial in each of so many situations, each planned for what the cameras see."""
    results = []
    for number in range(1, trials + 1):
        situation = skill.draw(rng, wide=True)
        looks = skill.reacts or bool(skill.situated)
        results.append(
            _executed(client, skill, situation, f"{skill.name} {number}/{trials}", looks)
        )
    return results


def _executed(
    client: "GraphClient", skill: "Skill", situation: "Situation", what: str, look: bool
) -> "SkillResult":
    from dart_skill.session import SkillResult, in_words
    from dart_skill_nodes.comms import conversions

    made = client.execute(conversions.situation_msg(situation), look)
    trial = SkillResult(
        situation,
        conversions.task_outcome(made.outcome),
        "" if made.message == "executed" else made.message,
    )
    error = "not seen" if trial.error_m is None else f"{1e3 * trial.error_m:.1f} mm"
    say(
        f"{what}: {in_words(situation, units=skill.units)}:"
        f" {'done' if trial.outcome.success else 'failed'}, {error} {trial.why}".rstrip()
    )
    return trial


def tell_trial(feedback, messages: dict[int, str]) -> None:
    """A line for each trial of practice, whose message is kept under its number."""
    from dart_skill.session import in_words
    from dart_skill_nodes.comms import conversions

    if feedback.phase == "done":
        messages[feedback.number] = feedback.message
        outcome = feedback.outcome
        error = f"{1e3 * outcome.error:.1f} mm" if math.isfinite(outcome.error) else "not seen"
        where = in_words(conversions.situation(outcome.situation))
        say(
            f"trial {feedback.number}: {where}: {'done' if outcome.success else 'failed'}, {error}"
            f" {feedback.message}".rstrip()
        )


def practise(client: "GraphClient", trials: int) -> tuple["Practice.Result", list["SkillResult"]]:
    """Own trials in situations that the coach draws, each learned from: what the coach says, and
    the trials.
    """
    from dart_skill.session import SkillResult
    from dart_skill_nodes.comms import conversions

    messages: dict[int, str] = {}
    result = client.practise(trials, on_feedback=partial(tell_trial, messages=messages))
    made = [
        SkillResult(
            conversions.situation(one.situation),
            conversions.task_outcome(one),
            messages.get(number, ""),
        )
        for number, one in enumerate(result.outcomes, start=1)
    ]
    return result, made
