"""Plans of throws as messages."""

from dart_skill.skills.practice import Planned
from dart_skill.skills.throw import Throw
from dart_skill_nodes.comms import conversions


def throw_plan_msg(plan, skill=None):
    """The message of a plan for its own target."""
    skill = skill or Throw()
    asked, aim = skill.at(plan.thrown.target), skill.at(plan.thrown.aim)
    return conversions.planned_msg(Planned(plan, asked, plan.model_id, aim), "world", skill)
