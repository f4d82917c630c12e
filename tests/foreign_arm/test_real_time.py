"""The same in real time: the driver follows the wall clock, and nobody waits for anybody."""

import pytest

pytest.importorskip("mujoco", reason="the second arm needs MuJoCo: pip install -r requirements/test.txt, or make setup")

import numpy as np  # noqa: E402
from dart_skill_msgs.action import Throw  # noqa: E402

from tests.foreign_arm.session import LESSONS, TARGETS, session, teach  # noqa: E402

LATE, FEW = 3, 0.01
"""Periods, and the share of commands that may come later."""


def skip_if_late(outsider):
    """Where commands come later than any arm's bus would bring them, nothing is learned of the arm."""
    late = np.mean(np.array(outsider.driver.lags) > LATE)
    if late > FEW:
        pytest.skip(f"too busy for real time: {late:.1%} of the commands came later than {LATE} periods")


def test_in_real_time_four_throws_are_guided_and_one_goes_into_a_basket(tmp_path):
    """A busy machine makes the plant's clock stand still now and then: the arm then has up to three throws."""
    with session(tmp_path, seed=1, lockstep=False) as outsider:
        outsider.driver.lags.clear()
        teach(outsider, LESSONS[1:2])
        skip_if_late(outsider)
        teach(outsider, LESSONS[2:5])
        learned = outsider.call("/skill_learner/learn", at_least=4)
        assert learned.success, learned.message
        assert outsider.call("/commander/release_arm", data=False).success
        for _ in range(3):
            outsider.prepare(TARGETS[1])
            outsider.driver.lags.clear()
            result = outsider.throw(TARGETS[1])
            outsider.driver.run(0.5)
            if outsider.driver.person.in_basket(TARGETS[1]):
                break
            skip_if_late(outsider)
        assert result.code == Throw.Goal.OUTCOME_THROWN, result.message
        assert result.outcome.in_basket
