"""Darts on a graph: own throws whose aims the coach chooses, and a leg of 501 by the best policy
for the spread that came of it.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from dart_skill_nodes.verbs._run import say

if TYPE_CHECKING:
    from dart_skill_msgs.action import Practice
    from dart_skill_msgs.msg import Outcome

    from dart_skill.darts import ModelBasedAgent
    from dart_skill.session import Dart, Hit, LegSummary
    from dart_skill.skills.darts import Darts
    from dart_skill_nodes.client.graph_client import GraphClient


@dataclass(frozen=True)
class Practised:
    """Own darts, what the coach said of all of them, and what is known of the thrower afterwards."""

    darts: "tuple[Dart, ...]"
    result: "Practice.Result"
    agent: "ModelBasedAgent"


def practise_darts(client: "GraphClient", skill: "Darts", throws: int) -> Practised:
    """So many own darts, each of which is learned from."""
    messages: dict[int, str] = {}
    result = client.practise(throws, on_feedback=partial(_tell, skill=skill, messages=messages))
    agent = skill.agent()  # knows as much as that of the coach, which chooses
    darts = [
        _dart(skill, agent, outcome, messages.get(number, ""))
        for number, outcome in enumerate(result.outcomes, start=1)
    ]
    return Practised(tuple(darts), result, agent)


def _tell(feedback, skill: "Darts", messages: dict[int, str]) -> None:
    from dart_skill.darts import place_of
    from dart_skill_nodes.comms import conversions

    if feedback.phase == "done":
        messages[feedback.number] = feedback.message
        at = place_of(skill.aim(conversions.aimed(feedback.outcome.situation, skill)))
        off = (
            f"{1e3 * feedback.outcome.error:.0f} mm off"
            if math.isfinite(feedback.outcome.error)
            else "not seen"
        )
        say(f"dart {feedback.number} at {at}: {off}; {feedback.message}")


def _dart(skill: "Darts", agent: "ModelBasedAgent", outcome: "Outcome", message: str) -> "Dart":
    """A dart as its outcome tells of it; the agent learns from it."""
    from dataclasses import replace

    from dart_skill.session import after_the_throw, before_the_throw
    from dart_skill_nodes.comms import conversions

    dart = before_the_throw(agent)
    if not conversions.stamp_ns(outcome.header.stamp):
        agent.cannot()
    if not outcome.seen:
        return replace(dart, note=message or "nobody saw where the dart went")
    hit = skill.face.on_board(conversions.seen_at(outcome, conversions.LANDING))
    agent.tell(hit)
    return after_the_throw(dart, hit)


def play_leg(
    client: "GraphClient", skill: "Darts", agent: "ModelBasedAgent"
) -> "LegSummary | None":
    """`dart_skill.session.play_leg`, with the arm of the graph."""
    from dart_skill.session import play_leg as play

    return play(agent, partial(_throw_one, client, skill), say)


def _throw_one(client: "GraphClient", skill: "Darts", aim) -> "Hit":
    from dart_skill.session import Hit
    from dart_skill_nodes.comms import conversions

    made = client.practise(situations=[conversions.situation_msg(skill.aimed(aim))])
    if made.outcomes and made.outcomes[0].seen:
        return Hit(skill.face.on_board(conversions.seen_at(made.outcomes[0], conversions.LANDING)))
    return Hit(None, "nobody saw where the dart went" if made.success else made.message)
