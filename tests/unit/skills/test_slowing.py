"""A ball of another mass than config/world.yaml says is noticed by how the air slows it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.common.flight import DART, TENNIS_BALL, flight
from dart_skill.recording import read_demonstrations
from dart_skill.session import Session
from dart_skill.skills.learning import (
    DEFAULT,
    learn_prepared,
    learn_throwing,
    prepare,
)
from dart_skill.skills.observation import Slowing, find_flight
from dart_skill.skills.practice import PractisingSkill
from dart_skill.skills.protocol import load_skill, part_of
from tests.paths import BAGS

HEAVIER = 2.6
"""Mass of the ball that was thrown, of that which was expected: 150 g."""
TARGETS = [[1.85, 0.1, 0.4], [2.05, -0.4, 0.4], [1.75, 0.45, 0.4]]


def thrown(ball, noise=1e-3, seed=0, n=6, world=None):
    """Flights of a ball as cameras see them; world: how these stand in the world."""
    rng, time, world = (
        np.random.default_rng(seed),
        np.arange(0.0, 0.6, 0.01),
        world or Rotation.identity(),
    )
    seen = []
    for azimuth in np.linspace(-0.7, 0.7, n):
        velocity = 3.0 * np.array([np.cos(azimuth), np.sin(azimuth), 0.8])
        way = world.apply(flight(np.array([0.5, 0.0, 1.8]), velocity, time, ball)[0])
        position = way + noise * rng.standard_normal(way.shape)
        seen.append(Slowing.of(time, position, find_flight(time, position), TENNIS_BALL))
    return Slowing.together(seen)


@pytest.mark.parametrize("heavier", [0.5, 1.0, HEAVIER])
@pytest.mark.parametrize("askew", [0.0, 0.03])
def test_the_share_is_told_to_an_eighth_and_as_far_as_it_is_sure(heavier, askew):
    """Cameras that stand askew count, too: their gravity has a part across."""
    world = Rotation.from_rotvec([0.0, askew, 0.0])
    share, spread = thrown(
        replace(TENNIS_BALL, mass=heavier * TENNIS_BALL.mass), world=world
    ).share
    assert spread < 0.1 and share == pytest.approx(1.0 / heavier, rel=0.125, abs=3.0 * spread)


def test_only_what_is_sure_is_said():
    heavy = replace(TENNIS_BALL, mass=HEAVIER * TENNIS_BALL.mass)
    said = thrown(heavy).in_words(TENNIS_BALL)
    assert "as one of 58 g" in said and "config/world.yaml (ball_mass)" in said, said
    assert thrown(heavy, noise=0.02, n=2).in_words(TENNIS_BALL) == "", "cameras that see it badly"
    alike = replace(TENNIS_BALL, mass=1.2 * TENNIS_BALL.mass)
    assert thrown(alike).in_words(TENNIS_BALL) == "", "balls of a kind differ by so much"
    share, spread = Slowing.none().share
    assert np.isnan(share) and spread == np.inf and Slowing.none().in_words(TENNIS_BALL) == ""


def test_nothing_is_said_of_the_ball_that_is_expected_and_of_a_dart():
    shown = [prepare(one, DEFAULT) for one in read_demonstrations(BAGS / "demonstrations")]
    model = learn_prepared(shown)
    assert not any("ball" in fact for fact in model.facts)
    assert model.ball_in_words([thrown(replace(TENNIS_BALL, mass=0.2))])
    assert load_skill("darts").game.projectile == DART
    board = learn_prepared(shown, replace(DEFAULT, board=load_skill("darts").settings.board))
    assert board.ball_in_words([thrown(replace(TENNIS_BALL, mass=0.2))]) == ""


def test_a_mass_that_does_not_fit_is_said_after_the_first_throw_and_once():
    """A ball of 150 g under a model of 58 g landed too far, and the coach said nothing."""
    shown = read_demonstrations(BAGS / "demonstrations")
    skill = load_skill("throw")
    practice = part_of(skill, "practice")(skill, shown)
    assert "ball" not in practice.values()
    session = Session(seed=5)
    session.plant.change(replace(session.plant.settings, ball_mass_scale=HEAVIER))
    told = []
    for target in np.array(TARGETS):
        plan = practice.plan(skill.at(target)).plan
        told.append(practice.tell(session.throw(plan).demonstration, plan))
    session.close()
    assert [bool(one.message) for one in told] == [True, False, False], told
    grams = int(told[0].message.split("it has about ")[1].split(" g")[0])
    assert told[0].kept and abs(grams - 150) < 5, told[0].message
    assert "ball_mass" in practice.values()["ball"]
    own = learn_throwing([*shown[:3]])
    assert not PractisingSkill(shown[:3]).ball_in_words and not any("ball" in f for f in own.facts)
