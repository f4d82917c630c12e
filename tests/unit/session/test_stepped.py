"""Worlds whose arm does frame by frame what somebody else decides: what is observed, where the hand
goes, how a movement ends.
"""

from contextlib import closing

import numpy as np
import pytest

from dart_skill.arm import Grip, HandState, Speed
from dart_skill.session import PoseGuide, features_of, read_shown, stepped
from dart_skill.skills.protocol import load_skill
from tests.paths import BAGS

FPS = 50.0
HAND = slice(14, 21)
"""Where the pose of the hand stands in a state."""


def begun(name, seed=3):
    skill = load_skill(name)
    world = stepped(skill, seed)
    world.begin(skill.draw(np.random.default_rng(seed)), FPS)
    return world


def held(world, frames, opens=False, shift=(0.0, 0.0, 0.0)):
    """The hand moves by a shift, at an even pace, and the world is observed after each frame."""
    start = world.observed()[0][HAND].copy()
    seen = []
    for k in range(1, frames + 1):
        target = start.copy()
        target[:3] += np.array(shift) * k / frames
        world.act(np.append(target, float(opens)))
        seen.append(np.concatenate(world.observed()))
    return np.array(seen)


def test_the_hand_goes_where_it_is_told_and_the_fingers_with_it():
    with closing(begun("place")) as world:
        start = world.observed()[0][HAND].copy()
        held(world, 20)
        assert world.plant.holds and not world.done
        held(world, 50, shift=(0.0, 0.0, 0.1))
        held(world, 20)
        off = world.observed()[0][HAND][:3] - start[:3] - [0.0, 0.0, 0.1]
        assert np.linalg.norm(off) < 0.005, off
        held(world, 20, opens=True)
        assert not world.plant.holds and not world.done
        held(world, 70, opens=True)
        assert world.done and not world.succeeded and not world.message


def test_what_is_observed_is_laid_out_as_in_a_dataset():
    features = {one.key: one.names for one in features_of(read_shown(BAGS / "demonstrations"))}
    with closing(begun("throw")) as world:
        state, environment = world.observed()
        assert len(state) == len(features["observation.state"])
        assert len(environment) == len(features["observation.environment_state"])
        at = features["observation.environment_state"].index("basket.x [m]")
        assert environment[at : at + 3] == pytest.approx(world.plant.state.basket, abs=0.01)
        # the ball is in the hand
        assert np.linalg.norm(environment[:3] - state[HAND][:3]) < 0.3
        assert state[21] == environment[7] == environment[15] == 1.0


def test_the_same_seed_gives_the_same_world():
    seen = []
    for _ in range(2):
        with closing(begun("place", seed=5)) as world:
            seen.append(held(world, 10, shift=(0.0, 0.0, 0.02)))
    assert np.array_equal(*seen)


def test_a_jump_stops_the_arm_and_says_why():
    with closing(begun("place")) as world:
        held(world, 3, shift=(0.9, 0.0, 0.0))
        held(world, 3)
        assert world.done and "farther than the limit" in world.message


def test_only_some_skills_can_be_stepped():
    with pytest.raises(ValueError, match="'reach' cannot be stepped: place, throw can"):
        stepped(load_skill("reach"))


def test_a_guide_moves_within_a_period_and_stays():
    start = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    goal = np.array([0.1, 0.0, 0.0, 0.0, 0.0, np.sin(0.1), np.cos(0.1)])
    guide = PoseGuide(np.zeros(7), start, 0.02, Speed.CAREFUL, carries=False)
    hand = HandState(np.zeros(3), np.eye(3), np.zeros(6))
    before = guide.look(0.0, hand, 0)
    assert np.array_equal(before.reference.position, start[:3])
    assert before.grip == Grip.UNSPECIFIED
    guide.tell(goal, opens=False)
    halfway, after = (guide.look(time, hand, 0) for time in (0.01, 0.05))
    assert halfway.reference.position == pytest.approx([0.05, 0.0, 0.0])
    assert halfway.reference.velocity == pytest.approx([5.0, 0.0, 0.0, 0.0, 0.0, 10.0])
    # half of the turn of 0.2 rad
    assert halfway.reference.rotation[1, 0] == pytest.approx(np.sin(0.1))
    assert after.reference.position == pytest.approx(goal[:3])
    assert not after.reference.velocity.any()
    assert halfway.grip == Grip.CLOSE and not halfway.carries
    assert guide.look(0.2, hand, 0).carries
