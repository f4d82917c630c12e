"""DS-GMR as an estimator: inputs beside time, components in time, attractors that are known
already, and what is left as it was.
"""

import numpy as np
import pytest

from dart_skill.movement import (
    DSGMR,
    TaskFrame,
    TaskParameterisedMixture,
    attractor_from_motion,
    follow_attractor,
    smooth_derivatives,
)

TIME = np.linspace(0.0, 1.0, 101)
DISTANCES = np.linspace(1.0, 2.0, 6)
WORLD = [TaskFrame(np.eye(3), np.zeros(3))]
WITH_DISTANCE = [TaskFrame(np.eye(4), np.zeros(4))]


def path_to(distance):
    """From rest to rest, straight ahead for so long, with a bow to the left."""
    s = TIME**3 * (10 - 15 * TIME + 6 * TIME**2)
    return np.column_stack([distance * s, 0.2 * np.sin(np.pi * s)])


def reaching(**options):
    """A model whose only input beside time is the distance, learned from six of them."""
    model = DSGMR(10, n_inputs=1, partition="time", **options)
    return model.fit(
        [model.encode(TIME, path_to(one), noise=1e-5, inputs=[one]) for one in DISTANCES],
        [WITH_DISTANCE] * 6,
    )


@pytest.fixture(scope="module")
def model():
    return reaching()


@pytest.mark.parametrize("distance", [1.1, 1.7, 2.2])
def test_an_input_beside_time_says_how_far_the_movement_goes(model, distance):
    movement = model.reproduce(WITH_DISTANCE, TIME, [0.0, 0.0], [0.0, 0.0], inputs=[distance])
    np.testing.assert_allclose(movement.position, path_to(distance), atol=0.03)


def test_without_the_input_all_distances_are_averaged():
    model = DSGMR(10, partition="time")
    model.fit([model.encode(TIME, path_to(one), noise=1e-5) for one in DISTANCES], [WORLD] * 6)
    end = model.reproduce(WORLD, TIME, [0.0, 0.0], [0.0, 0.0]).position[-1]
    np.testing.assert_allclose(end, path_to(DISTANCES.mean())[-1], atol=0.03)


def test_an_input_may_change_with_time(model):
    early, late = (model.retrieve(WITH_DISTANCE, TIME, [one])[0] for one in (1.2, 1.8))
    switched, _ = model.retrieve(WITH_DISTANCE, TIME, np.where(TIME < 0.5, 1.2, 1.8)[:, None])
    np.testing.assert_allclose(
        switched, np.where(TIME[:, None] < 0.5, early, late), rtol=0, atol=1e-12
    )
    np.testing.assert_array_equal(model.retrieve(WITH_DISTANCE, TIME, 1.2)[0], early)


def test_components_in_time_are_those_of_the_mixture(model):
    demos = [model.encode(TIME, path_to(one), noise=1e-5, inputs=[one]) for one in DISTANCES]
    for overlap in (0.7, 0.4):
        own = (
            DSGMR(10, n_inputs=1, partition="time", overlap=overlap)
            .fit(demos, [WITH_DISTANCE] * 6)
            .mixture_
        )
        expected = TaskParameterisedMixture(10).fit_in_time(
            demos, [WITH_DISTANCE] * 6, overlap=overlap
        )
        np.testing.assert_array_equal(own.means_, expected.means_)
        np.testing.assert_array_equal(own.covariances_, expected.covariances_)


def test_an_attractor_that_is_known_is_not_computed_again(model):
    motion = smooth_derivatives(TIME, path_to(1.3), noise=1e-5)
    known = attractor_from_motion(*motion, model.stiffness)
    np.testing.assert_array_equal(
        model.features(TIME, known, [1.3]),
        model.encode(TIME, path_to(1.3), noise=1e-5, inputs=[1.3]),
    )
    np.testing.assert_array_equal(DSGMR(3).features(TIME, known), np.column_stack([TIME, known]))


@pytest.mark.parametrize("moving", [False, True])
def test_without_covariance_the_mean_is_the_same_to_the_last_bit(model, moving):
    frames = [WITH_DISTANCE * len(TIME)] if moving else WITH_DISTANCE
    mean, covariance = model.retrieve(frames, TIME, [1.4])
    alone, nothing = model.retrieve(frames, TIME, [1.4], covariance=False)
    np.testing.assert_array_equal(alone, mean)
    assert nothing is None and covariance.shape == (101, 2, 2)
    assert (
        model.reproduce(
            frames, TIME, [0.0, 0.0], [0.0, 0.0], inputs=[1.4], covariance=False
        ).covariance
        is None
    )


@pytest.mark.parametrize("partition", ["em", "time"])
def test_a_demonstration_without_weight_is_not_learned_from(partition):
    demos = [np.column_stack([TIME, path_to(one)]) for one in DISTANCES]
    weighted = DSGMR(4, partition=partition).fit(
        demos, [WORLD] * 6, [1.0, 1.0, 0.0, 0.0, 0.0, 0.5]
    )
    left = DSGMR(4, partition=partition).fit(
        [demos[i] for i in (0, 1, 5)], [WORLD] * 3, [1.0, 1.0, 0.5]
    )
    np.testing.assert_allclose(
        weighted.retrieve(WORLD, TIME)[0], left.retrieve(WORLD, TIME)[0], atol=1e-9
    )


def test_the_exact_step_is_what_the_attractor_is_followed_with(model):
    step = 0.004
    time = np.arange(-0.25, 0.75, step)
    attractor, _ = model.retrieve(WITH_DISTANCE, time, [1.5])
    exact = follow_attractor(attractor, step, [0.0, 0.0], [0.0, 1.0], model.stiffness)
    movement = model.reproduce(
        WITH_DISTANCE, time, [0.0, 0.0], [0.0, 1.0], inputs=[1.5], step=step
    )
    np.testing.assert_array_equal(movement.position, exact.position)
    measured = model.reproduce(WITH_DISTANCE, time, [0.0, 0.0], [0.0, 1.0], inputs=[1.5])
    np.testing.assert_allclose(measured.position, exact.position, atol=1e-9)


@pytest.mark.parametrize(
    "inputs", [None, [1.0, 2.0], np.ones((3, 1)), np.ones((101, 2)), [np.nan], ["far"]]
)
def test_inputs_that_do_not_fit_are_refused(model, inputs):
    with pytest.raises(ValueError, match="inputs"):
        model.retrieve(WITH_DISTANCE, TIME, inputs)


def test_wrong_use_is_refused_with_the_remedy(model):
    with pytest.raises(
        ValueError, match=r"inputs beside time must have shape \(0,\).*n_inputs says how many"
    ):
        DSGMR(3).features(TIME, path_to(1.0), [1.0])
    with pytest.raises(ValueError, match="partition must be one of"):
        DSGMR(3, partition="kmeans")
    with pytest.raises(ValueError, match="n_inputs must be an integer of at least 0"):
        DSGMR(3, n_inputs=-1)
    with pytest.raises(ValueError, match="overlap must be at least 0.001"):
        DSGMR(3, partition="time", overlap=0.0)
    with pytest.raises(ValueError, match="3 columns are too few for time, 2 further inputs"):
        DSGMR(3, n_inputs=2).fit([np.column_stack([TIME, path_to(1.0)])], [WORLD])
    with pytest.raises(ValueError, match="step is 0.02 s, but the stamps are 0.01 s apart"):
        model.reproduce(WITH_DISTANCE, TIME, [0.0, 0.0], [0.0, 0.0], inputs=[1.5], step=0.02)
    with pytest.raises(ValueError, match="time must have length 3"):
        DSGMR(3).features(TIME, np.ones((3, 2)))
    with pytest.raises(ValueError, match="call fit first"):
        DSGMR(3).product(WORLD)


# 7.5.2: variations


@pytest.fixture(scope="module")
def varied():
    """Paths that begin alike and end apart, in one frame; a model of them, its frame, and stamps."""
    rng, time = np.random.default_rng(5), np.arange(0.0, 1.0, 0.02)
    frame = [TaskFrame(np.eye(3), np.zeros(3))]
    ends = rng.normal([0.4, 0.0], [0.02, 0.1], (12, 2))
    shown = [np.column_stack([time, np.outer(time**2, end)]) for end in ends]
    return DSGMR(5, 200.0).fit(shown, [frame] * len(shown)), frame, time


def test_variations_have_the_mean_and_the_covariance_of_the_regression(varied):
    model, frame, time = varied
    mean, covariance = model.retrieve(frame, time)
    drawn = model.variations(frame, time, 20000, np.random.default_rng(1))
    whitened = np.einsum(
        "tij,ntj->nti", np.linalg.inv(np.linalg.cholesky(covariance)), drawn - mean
    )
    np.testing.assert_allclose(whitened.mean(axis=0), 0.0, atol=5.0 / np.sqrt(20000))
    np.testing.assert_allclose(
        np.einsum("nti,ntj->tij", whitened, whitened) / 20000,
        np.tile(np.eye(2), (len(time), 1, 1)),
        atol=0.06,
    )


def test_variations_are_smooth_and_the_length_says_how(varied):
    model, frame, time = varied
    short, long = (
        model.variations(frame, time, 400, np.random.default_rng(2), smoothness=length)
        for length in (0.05, 0.5)
    )
    rough = [np.abs(np.diff(drawn, 2, axis=1)).mean() for drawn in (short, long)]
    assert rough[1] < 0.2 * rough[0]
    mean, covariance = model.retrieve(frame, time)
    k = 25  # correlation of neighbours at 0.06 s, of a Gaussian process with this kernel
    one, other = ((short[:, i, 1] - mean[i, 1]) / np.sqrt(covariance[i, 1, 1]) for i in (k, k + 3))
    assert np.corrcoef(one, other)[0, 1] == pytest.approx(
        np.exp(-0.5 * (0.06 / 0.05) ** 2), abs=0.1
    )


def test_variations_go_apart_where_the_demonstrations_did_and_the_same_seed_gives_the_same(varied):
    model, frame, time = varied
    drawn = model.variations(frame, time, 200, np.random.default_rng(3))
    spread = drawn.std(axis=0)
    assert spread[-1, 1] > 5.0 * spread[0, 1] and spread[-1, 1] > 3.0 * spread[-1, 0]
    np.testing.assert_array_equal(
        drawn, model.variations(frame, time, 200, np.random.default_rng(3))
    )
    with pytest.raises(ValueError, match="smoothness"):
        model.variations(frame, time, 2, np.random.default_rng(3), smoothness=0.0)
