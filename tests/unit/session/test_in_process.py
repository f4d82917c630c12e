"""The whole chain in one process: guided throws, learning, a throw at a new basket, and who knows
what.
"""

import numpy as np
import pytest

from dart_skill.arm import CommanderSettings, Mode, PlanRefused, same_plan
from dart_skill.session import Session
from dart_skill.skills.learning import learn_throwing
from dart_skill.skills.observation import judge_flight
from tests.recorded_session import same

BASKET = np.array([1.85, 0.15, 0.40])


@pytest.fixture(scope="module")
def learned(demonstrations):
    return learn_throwing(demonstrations).plan(BASKET)


@pytest.fixture(scope="module")
def thrown(learned):
    session = Session(seed=11, keep_states=True)
    trial = session.throw(learned)
    yield session, trial
    session.close()


def test_a_learned_throw_lands_at_the_basket(thrown):
    _, trial = thrown
    assert trial.outcome.landing_seen
    assert trial.outcome.landing_error < 0.03, trial.outcome


def test_the_cameras_and_the_simulator_agree(thrown, taught):
    for trial in (thrown[1], *taught):
        assert trial.outcome.in_basket == trial.ball_was_in
        below = next(
            s
            for s in trial.states
            if not s.ball_held and s.ball_position[2] < trial.demonstration.target[2]
        )
        assert np.linalg.norm(trial.outcome.landing - below.ball_position) < 0.02
        assert trial.outcome.landing_time * 1e9 + (
            trial.demonstration.stamp_ns + trial.demonstration.opened * 1e9
        ) == pytest.approx(below.stamp_ns, abs=6e6)


def test_the_throw_itself_is_a_demonstration(thrown, learned):
    trial = thrown[1]
    d = trial.demonstration
    np.testing.assert_allclose(d.target, BASKET, atol=1e-3)
    assert d.hand_time[0] <= d.motion_start < d.opened < d.motion_stop
    assert d.motion_stop - d.motion_start == pytest.approx(learned.path.duration, abs=0.3)
    learn_throwing([d, d])


def test_teaching_tries_again_until_the_ball_is_in(taught):
    session = Session(seed=3)
    trials = session.teach(np.array([2.0, 0.1, 0.4]), attempts=3)
    assert 1 <= len(trials) <= 3
    assert all(not trial.outcome.in_basket for trial in trials[:-1])
    assert len(trials) == 3 or trials[-1].outcome.in_basket
    assert all(trial.demonstration.id.startswith("demonstration_") for trial in trials)
    session.close()


def same_trial(first, second):
    return same(first.demonstration, second.demonstration) == []


def test_the_same_seed_gives_the_same_throw_to_the_last_bit(thrown, learned):
    again, other = Session(seed=11), Session(seed=12)
    trial, another = again.throw(learned), other.throw(learned)
    assert same_trial(trial, thrown[1])
    np.testing.assert_array_equal(trial.outcome.landing, thrown[1].outcome.landing)
    assert not np.array_equal(another.outcome.landing, trial.outcome.landing)
    again.close()
    other.close()


def test_learning_sees_nothing_that_only_the_simulator_knows(demonstrations, taught_targets):
    """A session whose plant tells lies in every field that no sensor reads gives the same
    demonstrations and the same plan.
    """
    session = Session(seed=3)
    truthful = type(session.plant).state

    class Lying(type(session.plant)):
        @property
        def state(self):
            state, rng = truthful.fget(self), np.random.default_rng(self.step_count)
            vars(state).update(
                effort=rng.normal(size=7),
                ball_velocity=rng.normal(size=3),
                ball_held=False,
                ball_in_basket=True,
            )
            return state

    session.plant.__class__ = Lying
    told = [session.teach(target, attempts=1)[0] for target in taught_targets[:2]]
    assert all(trial.ball_was_in for trial in told), "the lies were told"
    plans = [
        learn_throwing(shown).plan(BASKET)
        for shown in ([trial.demonstration for trial in told], demonstrations[:2])
    ]
    assert same_plan(*plans)
    session.close()


def test_the_outcome_is_that_of_the_ball_as_the_cameras_saw_it(thrown):
    d, outcome = thrown[1].demonstration, thrown[1].outcome
    judged = judge_flight(d.moved.time, d.moved.position, BASKET, 0.15)
    np.testing.assert_allclose(judged.landing, outcome.landing, atol=2e-3)
    assert judged.in_basket == outcome.in_basket


def test_a_plan_that_is_refused_changes_nothing(learned, thrown):
    session = Session(seed=11, commander=CommanderSettings.configured(fastest_hand=1.0))
    with pytest.raises(PlanRefused, match="the limit of a throw is 1.0 m/s"):
        session.throw(learned)
    assert session.commander.mode == Mode.HOLDING
    session.close()


def test_a_throw_that_is_stopped_before_the_release_says_why(learned):
    session = Session(seed=11, commander=CommanderSettings.configured(farthest_error=1e-5))
    with pytest.raises(ValueError, match="stopped: .*farther than the limit of 1e-05 m"):
        session.throw(learned)
    session.close()


def test_a_person_who_is_too_fast_is_stopped_and_the_next_throw_can_be_made(learned):
    """The limit holds for this throw of the person only: nothing is latched in a world that is
    built anew.
    """
    session = Session(
        seed=11, commander=CommanderSettings.configured(fastest_hand=2.9, fastest_elbow=0.3)
    )
    for attempt in (
        lambda: session.teach(BASKET),
        lambda: session.teach(BASKET),
        lambda: session.throw(learned),
    ):
        with pytest.raises(ValueError, match="stopped.* moves at") as caught:
            attempt()
        assert (
            not isinstance(caught.value, PlanRefused)
            and "the elbow moves at" in session.commander.stopped_by
        )
    session.close()
