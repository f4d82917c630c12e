"""The simulated graph in real time: the world goes on, whether it is answered or not."""

import pytest
from dart_skill_msgs.action import Execute

from dart_skill.common.regions import targets_for
from tests.integration.conftest import teach_and_learn

SLOWLY = {"lockstep": False, "speed_factor": 0.2}
"""A fifth as fast as the wall clock, so that a machine that does other things, too, has time to
answer.
"""


@pytest.mark.slow
def test_in_real_time_throws_are_shown_and_learned_and_one_goes_in(make_graph):
    """The hand never opened: whatever was shown missed."""
    _, client = make_graph(
        extra={"composed": {f"wam_simulator:{name}": value for name, value in SLOWLY.items()}}
    )
    shown, (target,) = targets_for(0, 2, 1)
    assert teach_and_learn(client, shown).demonstrations == 2
    results = [client.throw(target)]
    while not results[-1].outcome.success and len(results) < 3:
        results.append(client.throw(target))
    assert results[-1].code == Execute.Goal.OUTCOME_EXECUTED and results[-1].outcome.success, [
        (one.message, one.outcome.error) for one in results
    ]
