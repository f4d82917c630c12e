"""Masked arrays, and tables of pandas with missing values: refused where they are given, never
taken for numbers.
"""

import numpy as np
import pandas as pd
import pytest

from dart_skill.common.checks import check_samples, check_unit_quaternions, floats
from dart_skill.mixture import (
    Gaussian,
    GaussianMixture,
    GaussianMixtureEstimator,
    GaussianMixtureRegressor,
    select_by_bic,
)
from dart_skill.movement import (
    DSGMR,
    DiscretePrimitive,
    TaskFrame,
    angles_from_quaternions,
    estimate_noise,
    find_faults,
    normalise,
    smooth_derivatives,
    speed,
    warped_distance,
)
from dart_skill.policy_search import PoWER
from dart_skill.recording.imports import PoseStream, RigidTransform
from tests.throw_demonstrations import throw_demonstration

N = 30
TIME = np.linspace(0.0, 1.0, N)
ROWS = np.column_stack([np.sin(TIME), np.cos(TIME), TIME])
TURNS = np.tile([0.0, 0.0, 0.0, 1.0], (N, 1))
STAMPS = np.arange(N)


def masked(values, row=3):
    """With a row masked, below which is what was there before."""
    found = np.ma.array(values)
    found[row] = np.ma.masked
    return found


def nullable(values, row=3):
    """A table of pandas with a missing value."""
    frame = pd.DataFrame(values).astype("Float64")
    frame.iloc[row, 0] = pd.NA
    return frame


def demonstration(**changed):
    joints = np.zeros((N, 7))
    content = {
        "hand_time": TIME,
        "hand_position": ROWS,
        "hand_quaternion": TURNS,
        "ball_time": TIME,
        "ball_position": ROWS,
    }
    content |= {
        "joint_time": TIME,
        "joint_position": joints,
        "joint_velocity": joints,
        "target": np.array([2.0, 0.3, 0.4]),
    }
    return throw_demonstration(id="a", stamp_ns=0, **{**content, **changed})


ENTRIES = {
    "mixture": lambda bad: GaussianMixture(2).fit(bad(ROWS), rng=np.random.default_rng(0)),
    "weights of a mixture": lambda bad: GaussianMixture(2).fit(
        ROWS, bad(np.ones((N, 1)))[0] if bad is nullable else masked(np.ones(N))
    ),
    "number of components": lambda bad: select_by_bic(
        bad(ROWS), [1, 2], rng=np.random.default_rng(0)
    ),
    "Gaussian": lambda bad: Gaussian(np.zeros(N), bad(np.eye(N))),
    "estimator": lambda bad: GaussianMixtureEstimator(2).fit(bad(ROWS)),
    "regressor": lambda bad: GaussianMixtureRegressor(2).fit(ROWS[:, :1], bad(ROWS[:, 1:])),
    "prediction": lambda bad: (
        GaussianMixtureRegressor(1).fit(ROWS[:, :1], ROWS[:, 1]).predict(bad(ROWS[:, :1]))
    ),
    "derivatives": lambda bad: smooth_derivatives(TIME, bad(ROWS)),
    "noise": lambda bad: estimate_noise(TIME, bad(ROWS)),
    "quaternions": lambda bad: normalise(bad(TURNS)),
    "angles": lambda bad: angles_from_quaternions(bad(TURNS)),
    "frame": lambda bad: TaskFrame(bad(np.eye(4)), np.zeros(4)),
    "speed": lambda bad: speed(TIME, bad(ROWS)),
    "faults": lambda bad: find_faults(TIME, bad(ROWS)),
    "distance of paths": lambda bad: warped_distance(ROWS, bad(ROWS)),
    "primitive": lambda bad: DiscretePrimitive().fit([TIME], [bad(ROWS)]),
    "DS-GMR": lambda bad: DSGMR(2).fit(
        [bad(ROWS)], [[TaskFrame(np.eye(3), np.zeros(3))]], rng=np.random.default_rng(0)
    ),
    "demonstration, hand": lambda bad: demonstration(hand_position=bad(ROWS)),
    "demonstration, joints": lambda bad: demonstration(joint_velocity=bad(np.zeros((N, 7)))),
    "demonstration, quaternions": lambda bad: demonstration(hand_quaternion=bad(TURNS)),
    "series": lambda bad: check_samples("series", TIME, bad(ROWS)),
    "unit quaternions": lambda bad: check_unit_quaternions("poses", bad(TURNS), N),
}


@pytest.mark.parametrize("bad", [masked, nullable], ids=["masked", "pandas"])
@pytest.mark.parametrize("entry", ENTRIES.values(), ids=ENTRIES)
def test_masked_and_missing_values_are_refused(entry, bad):
    with pytest.raises(ValueError, match="nan|NaN|not finite|norm"):
        entry(bad)


def test_times_targets_and_returns_are_no_exception():
    with pytest.raises(ValueError, match="not finite"):
        demonstration(hand_time=masked(TIME))
    with pytest.raises(ValueError, match="position"):
        demonstration(target=masked(np.array([2.0, 0.3, 0.4]), 1))
    with pytest.raises(ValueError, match="position"):
        RigidTransform(masked(np.zeros(3), 0))
    search = PoWER(np.zeros(2), 1.0, rng=np.random.default_rng(0))
    search.tell(search.ask(), np.ma.masked_array(5.0, mask=True))
    assert search.best_return != 5.0, "a masked return is that of a trial that failed"


def test_poses_that_are_masked_were_not_seen():
    stream = PoseStream("hand", STAMPS, masked(ROWS), masked(TURNS, 4))
    assert np.isnan(stream.position[3]).all() and np.isnan(stream.quaternion[4]).all()
    np.testing.assert_array_equal(
        np.delete(stream.position, 3, axis=0), np.delete(ROWS, 3, axis=0)
    )


def test_what_is_not_masked_is_taken_as_it_is():
    whole = np.ma.array(ROWS)
    np.testing.assert_array_equal(floats(whole), ROWS)
    np.testing.assert_array_equal(floats(pd.DataFrame(ROWS).astype("Float64")), ROWS)
    np.testing.assert_array_equal(floats(pd.Series(TIME)), TIME)
    np.testing.assert_array_equal(
        floats([np.ma.array([1.0, 2.0], mask=[0, 1]), [3.0, 4.0]]), [[1.0, np.nan], [3.0, 4.0]]
    )
    assert floats(ROWS) is ROWS
    first, second = (
        GaussianMixture(2).fit(rows, rng=np.random.default_rng(0))
        for rows in (ROWS, pd.DataFrame(whole))
    )
    np.testing.assert_array_equal(first.means_, second.means_)
