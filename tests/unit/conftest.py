"""What several tests of the arm share: plants that are closed again, a plan that was not learned,
demonstrations that were taught once.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import (
    ArmModel,
    ExpectedThrow,
    Gains,
    Grip,
    GripEvent,
    HandPath,
    MotionPlan,
    Speed,
)
from dart_skill.common.flight import landing
from dart_skill.session import Session
from dart_skill.simulation import Plant, PlantSettings

NUMPY_SOLVES = np.linalg.solve


def solve_alike(left, right):
    """`numpy.linalg.solve`, unless NumPy 1.26 and NumPy 2 understand the right side differently:
    as vectors, or as a matrix.
    """
    n_left, n_right = np.ndim(left), np.ndim(right)
    assert (n_right == n_left - 1) == (n_right == 1), (
        f"solve of {np.shape(left)} and {np.shape(right)}: NumPy 1.26 takes one dimension less for"
        " a stack of vectors, NumPy 2 does not; write solve(left, right[None]) for one matrix,"
        " solve(left, right[..., None])[..., 0] for vectors"
    )
    return NUMPY_SOLVES(left, right)


@pytest.fixture(scope="session", autouse=True)
def _solves_alike():
    """Every call of `numpy.linalg.solve` in unit tests has the same meaning in NumPy 1.26 and
    NumPy 2.
    """
    np.linalg.solve = solve_alike
    yield
    np.linalg.solve = NUMPY_SOLVES


READY = (0.0, -0.90, 0.0, -0.75, 0.0, -0.35, 0.0)
"""A posture between throws: cocked, hand behind the shoulder."""
TARGETS = np.array(
    [[1.80, -0.60, 0.40], [2.00, 0.10, 0.40], [2.15, 0.70, 0.40], [1.65, 0.40, 0.40]]
)
"""Baskets of the demonstrations that the tests of the skill learn from."""


@pytest.fixture
def make_plant():
    """Makes plants from settings and a seed; closes them at the end."""
    plants = []

    def make(seed=0, **settings):
        plants.append(Plant(PlantSettings(**{"start_posture": READY, **settings}), seed))
        return plants[-1]

    yield make
    for plant in plants:
        plant.close()


@pytest.fixture(scope="session")
def taught_targets():
    """The baskets (n, 3) of the taught throws."""
    return TARGETS


@pytest.fixture(scope="session")
def taught():
    """One guided throw at each of TARGETS, as the session saw it: a list of trials, with the
    states of the plant.
    """
    session = Session(seed=3, keep_states=True)
    trials = [session.teach(target, attempts=1)[0] for target in TARGETS]
    session.close()
    return trials


@pytest.fixture(scope="session")
def demonstrations(taught):
    """The demonstrations of the taught throws."""
    return [trial.demonstration for trial in taught]


def swing(time, start, way, duration):
    """Joint angles, velocities, accelerations (n, 7) of a motion from rest to rest whose speed is
    the square of a half sine.
    """
    s = np.clip(time / duration, 0.0, 1.0)[:, None]
    shape = s - np.sin(2 * np.pi * s) / (2 * np.pi)
    rate = (1 - np.cos(2 * np.pi * s)) / duration
    change = 2 * np.pi * np.sin(2 * np.pi * s) / duration**2
    return start + way * shape, way * rate, way * change


def planned_swing(
    way=(0.0, 1.5, 0.0, 0.9, 0.0, 0.5, 0.0),
    duration=1.1,
    release=0.55,
    stiffness=200.0,
    step=0.004,
    start=READY,
):
    """A throw that was worked out joint by joint, without any learning; the attractor comes from
    (7.20), y = x + (d v + a) / k.
    """
    model, time = ArmModel(ball_in_hand=True), np.arange(0.0, duration + step, step)
    q, qd, qdd = swing(time, np.array(start), np.array(way), duration)
    pose = [model.hand_pose(row) for row in q]
    position, rotation = np.array([p for p, _ in pose]), np.array([r for _, r in pose])
    velocity = np.array([model.jacobian(a) @ b for a, b in zip(q, qd, strict=True)])
    acceleration = np.array(
        [
            model.jacobian(a) @ c + model.jacobian_drift(a, b)
            for a, b, c in zip(q, qd, qdd, strict=True)
        ]
    )
    damping = 2 * np.sqrt(stiffness)
    pull = (damping * velocity + acceleration) / stiffness
    attractor = Rotation.from_rotvec(pull[:, 3:]) * Rotation.from_matrix(rotation)
    k = round(release / step)
    arm = rotation[k] @ model.description.hand.ball_centre
    landed = landing(
        position[k] + arm, velocity[k, :3] + np.cross(velocity[k, 3:], arm), 0.4
    ).position
    gains = Gains(stiffness, damping)
    return MotionPlan(
        path=HandPath(time, position, Rotation.from_matrix(rotation).as_quat(), velocity, acceleration),
        attractor_position=position + pull[:, :3], attractor_quaternion=attractor.as_quat(),
        position_gains=gains, orientation_gains=gains, start_posture=np.array(start),
        end=release, what="throw", events=(GripEvent(release - 0.03, Grip.OPEN, release),),
        carries=True, speed=Speed.THROW, throw=ExpectedThrow(landed, landed, landed),
    )  # fmt: skip


@pytest.fixture(scope="session")
def plan():
    """A feasible throw over the top at about 3.5 m/s."""
    return planned_swing()


@pytest.fixture(scope="session")
def make_plan():
    """Makes plans like `plan`, with another way, duration or release."""
    return planned_swing
