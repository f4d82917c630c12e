"""The task-parameterised mixture and DS-GMR: shared EM, products (7.21), and invariances of the
task.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from dart_skill.mixture import Gaussian, GaussianMixture, product
from dart_skill.movement import (
    DSGMR,
    TaskFrame,
    TaskParameterisedMixture,
    target_frame,
)

STEPS = np.linspace(0.0, 1.0, 80)


def planar_frame(angle, x, y):
    matrix = np.eye(3)
    matrix[1:, 1:] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return TaskFrame(matrix, [0.0, x, y])


def reach(frames, rng=None, noise=0.0):
    """Attractor [t, y1, y2] that leaves the first frame along its x axis and enters the second so
    too.
    """
    start, goal = frames
    leave = start.from_frame([[0, 0.0, 0], [0, 0.3, 0]])[:, 1:]
    enter = goal.from_frame([[0, -0.3, 0], [0, 0.0, 0]])[:, 1:]
    points = np.concatenate([leave, enter])
    u = STEPS[:, None]
    bezier = (
        (1 - u) ** 3 * points[0]
        + 3 * u * (1 - u) ** 2 * points[1]
        + 3 * u**2 * (1 - u) * points[2]
        + u**3 * points[3]
    )
    wobble = 0.0 if rng is None else rng.normal(0, noise, bezier.shape)
    return np.column_stack([STEPS, bezier + wobble])


def situations(rng, n=6):
    return [
        [
            planar_frame(rng.uniform(-0.5, 0.5), *rng.uniform(-0.2, 0.2, 2)),
            planar_frame(rng.uniform(-1, 1), *rng.uniform(0.8, 1.5, 2)),
        ]
        for _ in range(n)
    ]


def taught(seed=0, noise=0.005, n=6):
    rng = np.random.default_rng(seed)
    frames = situations(rng, n)
    return [reach(one, rng, noise) for one in frames], frames


def assert_same(one, other, rtol=1e-8):
    for name in ("priors_", "means_", "covariances_"):
        left, right = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(
            left, right, rtol=rtol, atol=rtol * np.abs(right).max(), err_msg=name
        )


def test_one_identity_frame_is_an_ordinary_mixture():
    demos, _ = taught()
    identity = [[TaskFrame(np.eye(3), np.zeros(3))]] * len(demos)
    options = dict(tolerance=1e-13, max_iterations=3000)
    shared = TaskParameterisedMixture(3, **options).fit(demos, identity)
    stacked = np.concatenate(demos)
    # The ordinary mixture with the same parameters gives the same likelihood.
    plain = GaussianMixture.from_parameters(
        shared.priors_, shared.means_[0], shared.covariances_[0]
    )
    assert plain.log_density(stacked).sum() == pytest.approx(shared.log_likelihood_, rel=1e-9)
    np.testing.assert_allclose(shared.product(identity[0]).means_, shared.means_[0], rtol=1e-12)
    # At a fixed point of EM the parameters are their own weighted moments.
    shares = plain.responsibilities(stacked)
    np.testing.assert_allclose(
        shares.T @ stacked / shares.sum(0)[:, None], shared.means_[0], atol=1e-5
    )


def test_density_is_the_mixture_of_products_over_frames():
    demos, frames = taught()
    model = TaskParameterisedMixture(3).fit(demos, frames)
    terms = np.zeros((len(demos[0]), 3))
    for j, frame in enumerate(frames[0]):
        for k in range(3):
            gaussian = Gaussian(model.means_[j, k], model.covariances_[j, k])
            terms[:, k] += gaussian.log_density(frame.to_frame(demos[0]))
    expected = np.log(np.exp(terms) @ model.priors_)
    np.testing.assert_allclose(model.log_density(demos, frames)[0], expected, rtol=1e-9)
    shares = np.exp(terms + np.log(model.priors_) - expected[:, None])
    np.testing.assert_allclose(model.responsibilities(demos, frames)[0], shares, atol=1e-9)
    assert np.concatenate(model.log_density(demos, frames)).sum() == pytest.approx(
        model.log_likelihood_
    )


def test_product_is_that_of_the_mapped_gaussians():
    demos, frames = taught()
    model = TaskParameterisedMixture(3).fit(demos, frames)
    new = situations(np.random.default_rng(9), 1)[0]
    found = model.product(new)
    for k in range(3):
        mapped = [
            Gaussian(model.means_[j, k], model.covariances_[j, k]).linear_map(frame.A, frame.b)
            for j, frame in enumerate(new)
        ]
        precision = sum(np.linalg.inv(one.covariance) for one in mapped)
        np.testing.assert_allclose(np.linalg.inv(found.covariances_[k]), precision, rtol=1e-7)
        np.testing.assert_allclose(found.means_[k], product(mapped)[0].mean, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.priors_, model.priors_)


def test_features_in_units_that_are_far_apart_are_all_told():
    """Columns of equations are compared with themselves: a feature in a tiny unit is not one that
    no frame sees.
    """
    means, deviations = np.array([[0.5, 1e7, 2e-7]]), np.array([0.2, 1e7, 1e-7])
    mixture = TaskParameterisedMixture.from_parameters(
        [1.0], [means], [np.diag(deviations**2)[None]]
    )
    found = mixture.product([TaskFrame(np.eye(3), np.zeros(3))])
    np.testing.assert_allclose(found.means_, means, rtol=1e-12)
    np.testing.assert_allclose(found.covariances_[0], np.diag(deviations**2), rtol=1e-12)


def test_integer_weights_equal_repeated_demonstrations():
    demos, frames = taught()
    weights = [1, 2, 0, 1, 3, 1]
    repeated = [i for i, w in enumerate(weights) for _ in range(w)]
    options = dict(tolerance=1e-12, max_iterations=2000)
    weighted = TaskParameterisedMixture(3, **options).fit(demos, frames, weights)
    again = TaskParameterisedMixture(3, **options).fit(
        [demos[i] for i in repeated], [frames[i] for i in repeated]
    )
    assert_same(weighted, again, 1e-5)
    per_sample = [np.full(80, w) for w in weights]
    assert_same(
        weighted, TaskParameterisedMixture(3, **options).fit(demos, frames, per_sample), 1e-12
    )
    assert weighted.bic(demos, frames, weights) == pytest.approx(
        weighted.bic(demos, frames, per_sample)
    )


def test_turning_and_moving_every_task_changes_nothing_in_the_frames():
    demos, frames = taught()
    move = planar_frame(1.1, 3.0, -2.0)
    moved_frames = [
        [TaskFrame(move.A @ f.A, move.A @ f.b + move.b) for f in one] for one in frames
    ]
    moved = TaskParameterisedMixture(3).fit(
        [move.from_frame(demo) for demo in demos], moved_frames
    )
    plain = TaskParameterisedMixture(3).fit(demos, frames)
    assert_same(moved, plain, 1e-6)
    np.testing.assert_allclose(
        moved.product(moved_frames[0]).means_,
        move.from_frame(plain.product(frames[0]).means_),
        atol=1e-7,
    )


def test_kmeans_start_finds_components_that_mean_the_same_in_all_frames():
    demos, frames = taught()
    by_time = TaskParameterisedMixture(3).fit(demos, frames).log_likelihood_
    model = TaskParameterisedMixture(3, start="kmeans", n_starts=5).fit(
        demos, frames, rng=np.random.default_rng(0)
    )
    assert model.log_likelihood_ > by_time - 0.1 * abs(by_time), (model.log_likelihood_, by_time)
    np.testing.assert_allclose(model.means_[0, :, 0], model.means_[1, :, 0], rtol=1e-9)


def test_encode_resamples_onto_the_grid_asked_for():
    time = 0.01 * np.arange(50)
    grid = np.linspace(0.1, 0.3, 11)
    encoded = DSGMR(2, 100.0, 10.0).encode(
        time, np.stack([1 + time, time**2], 1), noise=0.0, at=grid
    )
    expected = np.column_stack([grid, 1 + grid + 0.1, grid**2 + 0.2 * grid + 0.02])
    np.testing.assert_allclose(encoded, expected, atol=1e-9)


def test_static_attractors_at_the_target_are_encoded_and_found_again():
    """(8.1): the Gaussians shrink to the point, and must still be usable in the turned world."""
    rng = np.random.default_rng(5)
    frames = [[target_frame(rng.uniform([2, -1, 0], [3, 1, 1]), pointing=())] for _ in range(6)]
    demos = [np.column_stack([STEPS, np.tile(one[0].b[1:], (80, 1))]) for one in frames]
    model = DSGMR(2).fit(demos, frames)
    new = target_frame([2.5, 0.3, 0.4], pointing=())
    attractor, covariance = model.retrieve([new], STEPS)
    np.testing.assert_allclose(attractor, np.tile([2.5, 0.3, 0.4], (80, 1)), atol=1e-9)
    assert np.linalg.eigvalsh(covariance).min() > 0
    assert np.sqrt(np.linalg.eigvalsh(covariance).max()) < 1e-4


def test_a_push_during_the_motion_is_answered_as_7_19_says():
    """Against independent integration of x'' = kp (y - x) - kv x' + push, all of it straight
    between the stamps.
    """
    demos, frames = taught()
    model, push = DSGMR(4, stiffness=150.0).fit(demos, frames), np.zeros((80, 2))
    push[20:40] = np.random.default_rng(2).normal(0.0, 10.0, (20, 2))
    run = model.reproduce(frames[1], STEPS, [0.0, 0.1], [0.0, 0.0], push)
    kp, kv = model.stiffness, model.damping

    def rate(t, s):
        y, u = (
            [np.interp(t, STEPS, column) for column in rows.T] for rows in (run.attractor, push)
        )
        return np.concatenate([s[2:], kp * (np.array(y) - s[:2]) - kv * s[2:] + u])

    solution = solve_ivp(
        rate,
        (0.0, 1.0),
        [0.0, 0.1, 0.0, 0.0],
        t_eval=STEPS,
        max_step=1.0 / 79,
        rtol=1e-9,
        atol=1e-11,
    )
    np.testing.assert_allclose(run.position, solution.y[:2].T, atol=1e-6)
    np.testing.assert_allclose(
        run.acceleration,
        [rate(t, s)[2:] for t, s in zip(STEPS, solution.y.T, strict=True)],
        atol=1e-3,
    )
    free = model.reproduce(frames[1], STEPS, [0.0, 0.1], [0.0, 0.0])
    assert np.abs(free.position - run.position).max() > 0.01
    np.testing.assert_array_equal(free.position[:20], run.position[:20])


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda d, f: (d, f[:-1]), "one list of frames per demonstration"),
        (lambda d, f: ([], []), "one list of frames"),
        (lambda d, f: (d, [f[0][:1]] + f[1:]), "demonstration 1 has 2 task frames"),
        (lambda d, f: (d, [[] for _ in f]), "expected at least 1"),
        (
            lambda d, f: ([d[0][:, :2]] + d[1:], f),
            "demonstration 1 has 3 columns, the first has 2",
        ),
        (lambda d, f: ([one[:, :2] for one in d], f), "has 3 dimensions, the samples have 2"),
        (
            lambda d, f: (d[:-1] + [np.full((4, 3), np.nan)], f),
            "samples of demonstration 5 holds nan",
        ),
        (lambda d, f: ([one[:0] for one in d], f), "empty"),
    ],
)
def test_demonstrations_that_do_not_fit_together_are_refused(spoil, message):
    with pytest.raises(ValueError, match=message):
        TaskParameterisedMixture(3).fit(*spoil(*taught()))


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ([1.0], "1 entries for 6"),
        ([0.0] * 6, "all zero"),
        ([-1.0] * 6, "negative"),
        ([np.ones(3)] + [1.0] * 5, "has length 3, its samples 80"),
    ],
)
def test_unusable_weights_are_refused(weights, message):
    with pytest.raises(ValueError, match=message):
        TaskParameterisedMixture(3).fit(*taught(), weights)


def test_wrong_use_is_refused_with_the_remedy():
    demos, frames = taught()
    model = DSGMR(3)
    with pytest.raises(ValueError, match="call fit first"):
        model.retrieve(frames[0], STEPS)
    with pytest.raises(ValueError, match="start must be one of"):
        DSGMR(3, start="random")
    with pytest.raises(ValueError, match="needs start='kmeans'"):
        TaskParameterisedMixture(3, n_starts=4)
    with pytest.raises(ValueError, match="pass rng"):
        TaskParameterisedMixture(3, start="kmeans").fit(demos, frames)
    model.fit(demos, frames)
    with pytest.raises(ValueError, match="has 1 task frames, expected 2"):
        model.retrieve(frames[0][:1], STEPS)
    with pytest.raises(ValueError, match="equally spaced"):
        model.reproduce(frames[0], STEPS**2, [0, 0], [0, 0])
    with pytest.raises(ValueError, match="length 2"):
        model.reproduce(frames[0], STEPS, [0, 0, 0], [0, 0])
    with pytest.raises(ValueError, match="push must have 80 rows"):
        model.reproduce(frames[0], STEPS, [0, 0], [0, 0], np.zeros((3, 2)))
    with pytest.raises(ValueError, match="not positive definite"):
        TaskParameterisedMixture.from_parameters([1.0], np.zeros((1, 1, 2)), np.ones((1, 1, 2, 2)))


# fitted around the times that EM found


def test_around_equal_intervals_it_is_the_fit_in_equal_intervals():
    samples, frames = taught()
    expected = TaskParameterisedMixture(5).fit_in_time(samples, frames, overlap=0.7)
    one = TaskParameterisedMixture(5).fit(samples, frames)
    interval = (STEPS[-1] - STEPS[0]) / 5
    means, covariances = np.array(one.means_), np.array(one.covariances_)
    means[..., 0], covariances[..., 0, 0] = (
        STEPS[0] + interval * (0.5 + np.arange(5)),
        interval**2 / 12.0,
    )
    covariances[..., 0, 1:] = covariances[..., 1:, 0] = 0.0
    equal = TaskParameterisedMixture.from_parameters(np.full(5, 0.2), means, covariances)
    assert_same(equal.fit_around(samples, frames, overlap=0.7), expected)


def test_each_component_is_of_all_demonstrations_then():
    """EM gives components to the two that go another way in the middle; each is then the average
    of what all do around its time.
    """
    time = np.arange(0.0, 1.0, 0.01)
    world, bump = [TaskFrame(np.eye(2), np.zeros(2))], np.exp(-0.5 * ((time - 0.5) / 0.08) ** 2)
    samples = [np.column_stack([time, time + height * bump]) for height in (0.0, 0.01, 0.4, 0.41)]
    one = TaskParameterisedMixture(6).fit(samples, [world] * 4)
    shares = np.array([part.sum(axis=0) for part in one.responsibilities(samples, [world] * 4)])
    assert (shares / shares.sum(axis=0)).min() < 0.05
    mean, deviation = one.means_[0][:, 0], 0.7 * one.priors_ * (time[-1] - time[0])
    window = np.exp(-0.5 * ((time[:, None] - mean) / deviation) ** 2) / deviation
    window /= window.sum(axis=1, keepdims=True)
    average = np.mean([sample[:, 1] for sample in samples], axis=0)
    smooth = one.fit_around(samples, [world] * 4, overlap=0.7)
    np.testing.assert_allclose(
        smooth.means_[0][:, 1], window.T @ average / window.sum(axis=0), atol=1e-9
    )


# features that all frames see alike


def conditional(mean, covariance, given, q):
    """Mean and covariance of the other features given the first q (q,)."""
    slope = np.linalg.solve(covariance[:q, :q], covariance[:q, q:]).T
    return mean[q:] + slope @ (given - mean[:q]), covariance[q:, q:] - slope @ covariance[:q, q:]


@pytest.mark.parametrize("n_frames", [1, 2, 3])
def test_a_frame_that_is_given_again_changes_nothing_that_is_retrieved(n_frames):
    """As (7.21) stands, time counts once for each frame, so components overlap the less the more
    frames there are.
    """
    samples, frames = taught()
    once = DSGMR(6).fit(samples, [one[:1] for one in frames])
    again = DSGMR(6, n_shared=1).fit(samples, [one[:1] * n_frames for one in frames])
    again.mixture_ = TaskParameterisedMixture.from_parameters(
        once.mixture_.priors_,
        [once.mixture_.means_[0]] * n_frames,
        [once.mixture_.covariances_[0]] * n_frames,
        n_shared=1,
    )
    expected, spread = once.retrieve(frames[0][:1], STEPS)
    found, narrower = again.retrieve(frames[0][:1] * n_frames, STEPS)
    off = np.abs(found - expected).max()
    again.mixture_.n_shared = 0
    as_it_stands = np.abs(again.retrieve(frames[0][:1] * n_frames, STEPS)[0] - expected).max()
    assert off < 1e-9 and (n_frames == 1 or as_it_stands > 1e-3), (off, as_it_stands)
    assert (
        np.linalg.eigvalsh(narrower)[:, -1] <= np.linalg.eigvalsh(spread)[:, -1] * (1 + 1e-9)
    ).all()


@pytest.mark.parametrize("seed", range(5))
def test_given_the_shared_features_the_frames_are_multiplied(seed):
    """For each component the product of the conditional densities of all frames, and the density
    of the shared features of the first.
    """
    rng, k, m, q = np.random.default_rng(seed), 3, 5, 2
    roots = rng.normal(size=(2, k, m, m))
    means, covariances = (
        rng.normal(size=(2, k, m)),
        roots @ np.swapaxes(roots, 2, 3) + 0.1 * np.eye(m),
    )
    frames = []
    for _ in range(2):
        turned = np.eye(m)
        turned[q:, q:] = Rotation.random(random_state=rng).as_matrix()
        frames.append(TaskFrame(turned, np.concatenate([np.zeros(q), rng.normal(size=m - q)])))
    mixture = TaskParameterisedMixture.from_parameters(
        np.full(k, 1 / k), means, covariances, n_shared=q
    )
    found, given = mixture.product(frames), rng.normal(size=q)
    for i in range(k):
        parts = [
            conditional(one.A @ mean[i] + one.b, one.A @ covariance[i] @ one.A.T, given, q)
            for one, mean, covariance in zip(frames, means, covariances, strict=True)
        ]
        spread = np.linalg.inv(sum(np.linalg.inv(part) for _, part in parts))
        centre = spread @ sum(np.linalg.solve(part, middle) for middle, part in parts)
        mean, covariance = conditional(found.means_[i], found.covariances_[i], given, q)
        np.testing.assert_allclose(mean, centre, rtol=1e-8, atol=1e-10)
        np.testing.assert_allclose(covariance, spread, rtol=1e-8, atol=1e-10)
        np.testing.assert_allclose(found.means_[i, :q], means[0, i, :q], atol=1e-12)
        np.testing.assert_allclose(
            found.covariances_[i, :q, :q], covariances[0, i, :q, :q], rtol=1e-10
        )


def test_a_frame_that_is_missing_says_nothing_of_the_shared_features_either():
    samples, frames = taught()
    model = DSGMR(4, n_shared=1).fit(samples, frames)
    alone = DSGMR.from_mixture(
        TaskParameterisedMixture.from_parameters(
            model.mixture_.priors_,
            *([values[1]] for values in (model.mixture_.means_, model.mixture_.covariances_)),
        )
    )
    np.testing.assert_allclose(
        model.retrieve([None, frames[0][1]], STEPS)[0],
        alone.retrieve(frames[0][1:], STEPS)[0],
        rtol=1e-8,
        atol=1e-10,
    )


def test_features_that_a_frame_changes_are_not_shared():
    samples, frames = taught()
    with pytest.raises(ValueError, match="a task frame changes one of the first 2 features"):
        DSGMR(4, n_shared=2).fit(samples, frames).product(frames[0])
    with pytest.raises(ValueError, match="n_shared is 3: of 3 features"):
        DSGMR(4, n_shared=3).fit(samples, frames).product(frames[0])
