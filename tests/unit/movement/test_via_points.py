"""Via points of all members: met exactly, or as their covariance says, against the conditioning of
one large Gaussian, Gaussian processes, and regression written out.
"""

import numpy as np
import pytest

from dart_skill.mixture import Gaussian
from dart_skill.movement import (
    DSGMR,
    KMP,
    PerStepGaussians,
    ProMP,
    TaskFrame,
    follow_attractor,
)

TIME = np.linspace(0.0, 2.0, 101)
WORLD = TaskFrame(np.eye(3), np.zeros(3))


def path(end, bend):
    s = (TIME / TIME[-1])[:, None]
    s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return s * end + bend * np.sin(np.pi * s)


@pytest.fixture(scope="module")
def shown():
    rng = np.random.default_rng(0)
    return [path(rng.normal([0.5, 0.3], 0.05), rng.normal([0.0, 0.1], 0.04)) for _ in range(8)]


@pytest.fixture(scope="module")
def samples(shown):
    return [np.column_stack([TIME, one]) for one in shown]


def frames(end):
    return [WORLD, TaskFrame(np.eye(3), [0.0, *end])]


@pytest.fixture(scope="module", params=["per step", "ProMP", "ProMP, prior", "KMP"])
def member(request, samples):
    """(model, what gives mean and covariance at instants)."""
    if request.param == "per step":
        model = PerStepGaussians(101).fit(samples, [frames(one[-1, 1:]) for one in samples])
        return model, lambda fitted, time: fitted.retrieve(frames([0.5, 0.3]), time)
    model = {
        "ProMP": ProMP(),
        "ProMP, prior": ProMP(covariance_prior=2.0),
        "KMP": KMP(),
    }[request.param].fit(samples)
    return model, lambda fitted, time: fitted.retrieve(time)


def test_start_end_and_a_point_between_are_met(member):
    model, ask = member
    start, end, point = np.array([[0.02, -0.01], [0.55, 0.25], [0.3, 0.32]])
    led = model.between(start, end).condition(0.9, point)
    mean, covariance = ask(led, [0.0, 0.9, 2.0])
    np.testing.assert_allclose(mean, [start, point, end], atol=1e-6)
    assert np.abs(covariance).max() < 1e-6
    before = ask(model, [0.9])[0]
    assert np.linalg.norm(before - point) > 0.02, "and the model itself is as it was"


def test_a_via_point_with_a_covariance_is_met_less_the_larger_it_is(member):
    model, ask = member
    point = ask(model, [1.0])[0][0] + [0.0, 0.05]
    off = [
        float(np.linalg.norm(ask(model.condition(1.0, point, c * np.eye(2)), [1.0])[0] - point))
        for c in (1e-8, 1e-4, 1e-2, 1e2)
    ]
    assert off[0] < 1e-3 and off == sorted(off) and off[-1] == pytest.approx(0.05, abs=1e-3)


def test_the_order_of_via_points_makes_no_difference(member):
    model, ask = member
    points = [(0.5, [0.1, 0.15]), (1.4, [0.45, 0.3]), (1.0, [0.2, 0.3])]
    one, other = model, model
    for forth, back in zip(points, reversed(points), strict=True):
        one, other = one.condition(*forth), other.condition(*back)
    for first, second in zip(ask(one, TIME), ask(other, TIME), strict=True):
        np.testing.assert_allclose(first, second, atol=1e-7)


def test_what_is_no_via_point_is_said(member):
    model, _ = member
    for time, point, covariance, why in (
        (2.5, [0.0, 0.0], None, "outside of the movement, which is from 0 to 2 s"),
        (np.nan, [0.0, 0.0], None, "time holds nan"),
        (1.0, [0.0], None, "position must have length 2, got 1"),
        (1.0, [0.0, 0.0], np.eye(3), r"covariance must have shape \(2, 2\)"),
    ):
        with pytest.raises(ValueError, match=why):
            model.condition(time, point, covariance)


def test_via_points_are_not_saved_but_the_model_is(member, tmp_path):
    model, ask = member
    with pytest.raises(ValueError, match="of one situation and are not saved"):
        model.condition(1.0, [0.2, 0.2]).save(tmp_path / "led.npz")
    model.save(tmp_path / "model.npz")
    again = type(model).load(tmp_path / "model.npz")
    for saved, here in zip(ask(again, TIME), ask(model, TIME), strict=True):
        np.testing.assert_array_equal(saved, here)
    assert "8 demonstrations, 2 movement variables" in repr(again)


def test_per_step_gaussians_are_conditioned_as_one_large_gaussian(samples):
    """x = mu + R z, with the roots R of S and of e^2 I, written out over all steps."""
    model = PerStepGaussians(21, smoothness=0.3).fit(samples, [[WORLD]] * 8)
    mean, covariance = model.retrieve([WORLD])
    slack = np.trace(covariance, axis1=1, axis2=2).mean() / 2.0 * np.eye(2)
    values, axes = np.linalg.eigh(covariance + slack)
    root = np.einsum("tij,tj,tkj->tik", axes, np.sqrt(values), axes)
    kernel = np.exp(-0.5 * ((model.time_[:, None] - model.time_) / 0.3) ** 2)
    joint = np.einsum("ts,tij,skj->tisk", kernel, root, root).reshape(42, 42)
    noise = np.array([[2e-4, 1e-4], [1e-4, 3e-4]])
    k, point = 8, mean[8] + [0.05, -0.03]
    seen = joint[2 * k : 2 * k + 2]
    gain = np.linalg.solve(seen[:, 2 * k : 2 * k + 2] + noise, seen)
    expected = mean + ((point - mean[k]) @ gain).reshape(21, 2)
    led = model.condition(float(model.time_[k]), point, noise)
    np.testing.assert_allclose(led.retrieve([WORLD])[0], expected, atol=1e-9)


def test_a_promp_is_conditioned_as_the_gaussian_of_its_weights(samples):
    """`Gaussian.condition` of weights and what is observed, side by side."""
    model = ProMP(8).fit(samples)
    mean, covariance = model.weights()
    phase = (np.array([0.35]) - np.linspace(0.0, 1.0, 8)) * 7.0
    heights = np.exp(-0.5 * phase**2)
    basis = np.kron(np.eye(2), heights / heights.sum())
    noise, point = 1e-4 * np.eye(2), np.array([0.2, 0.25])
    both = Gaussian(
        np.concatenate([mean, basis @ mean]),
        np.block(
            [
                [covariance, covariance @ basis.T],
                [basis @ covariance, basis @ covariance @ basis.T + noise],
            ]
        ),
    )
    expected = both.condition([16, 17], point)
    found, spread = model.condition(0.7, point, noise).weights()
    np.testing.assert_allclose(found, expected.mean, atol=1e-8)
    np.testing.assert_allclose(spread, expected.covariance, atol=1e-10)


def test_the_weights_of_a_promp_are_those_of_the_demonstrations(samples, shown):
    """Its mean is the mean of the demonstrations, and the prior takes away what the variables have
    in common.
    """
    model, apart = ProMP().fit(samples), ProMP(covariance_prior=1e9).fit(samples)
    mean, covariance = model.retrieve(TIME)
    np.testing.assert_allclose(mean, np.mean(shown, axis=0), atol=1e-3)
    expected = np.cov(np.array(shown)[:, 50].T, bias=True)
    np.testing.assert_allclose(covariance[50], expected, atol=3e-5)
    alone = apart.retrieve(TIME)[1][50]
    np.testing.assert_allclose(np.diag(alone), np.diag(expected), atol=3e-5)
    assert abs(alone[0, 1]) < 1e-9 < abs(expected[0, 1])


def test_a_promp_of_another_library_has_the_same_mean(samples, shown):
    peer = pytest.importorskip("movement_primitives.promp").ProMP(2, n_weights_per_dim=15)
    peer.imitate([TIME / 2.0] * 8, np.array(shown), n_iter=50)
    mine = ProMP().fit(samples).retrieve(TIME)[0]
    np.testing.assert_allclose(peer.mean_trajectory(TIME / 2.0), mine, atol=5e-3)


def test_a_kmp_is_a_gaussian_process_with_the_noise_of_its_reference(samples):
    """The mean of each variable alone, where the reference has no correlations."""
    model = KMP(regularisation=0.5, length=0.25, n_references=101).fit(samples)
    model.covariances_[:] *= np.eye(2)
    time = np.linspace(0.1, 1.9, 7)
    mean, covariance = model.retrieve(time)
    height = np.var(np.concatenate([one[:, 1:] for one in samples]), axis=0).mean()

    def kernel(a, b):
        return height * np.exp(-0.5 * ((a[:, None] - b) / 0.25) ** 2)

    for i in range(2):
        noise, middle = 0.5 * np.diag(model.covariances_[:, i, i]), model.means_[:, i].mean()
        gain = kernel(time, TIME) @ np.linalg.inv(kernel(TIME, TIME) + noise)
        expected = middle + gain @ (model.means_[:, i] - middle)
        np.testing.assert_allclose(mean[:, i], expected, atol=1e-7)
        left = np.diag(kernel(time, time) - gain @ kernel(TIME, time))
        np.testing.assert_allclose(covariance[:, i, i], left, atol=1e-9)


# DS-GMR


@pytest.fixture(scope="module")
def ds_gmr(shown):
    model = DSGMR(6, stiffness=[200.0, 300.0], n_shared=1)
    encoded = [model.encode(TIME, one, noise=1e-4) for one in shown]
    return model.fit(encoded, [frames(one[-1]) for one in shown])


def test_a_ds_gmr_ends_where_it_is_asked_to(ds_gmr):
    situation, still = frames([0.55, 0.2]), np.zeros(2)
    usual = ds_gmr.reproduce(situation, TIME, still, still)
    for end in ([0.55, 0.2], [0.6, 0.15]):
        led = ds_gmr.reproduce(situation, TIME, still, still, end=end)
        np.testing.assert_allclose(led.position[-1], end, atol=1e-12)
        np.testing.assert_array_equal(led.position[0], still)
        before = np.abs(led.position[:40] - usual.position[:40]).max()
        assert before < 1e-3, "the first part is as it was learned"


def test_a_ds_gmr_passes_through_a_point_with_and_without_a_push(ds_gmr):
    situation, still = frames([0.5, 0.3]), np.zeros(2)
    push = np.zeros((101, 2))
    push[30:60, 1] = 3.0
    led = ds_gmr.condition(1.013, [0.3, 0.35])
    for pushed in (None, push):
        made = led.reproduce(situation, TIME, still, still, pushed, end=[0.5, 0.3])
        met = [np.interp(1.013, TIME, column) for column in made.position.T]
        np.testing.assert_allclose(met, [0.3, 0.35], atol=1e-9)
        np.testing.assert_allclose(made.position[-1], [0.5, 0.3], atol=1e-9)
    assert np.linalg.eigvalsh(made.covariance).min() > -1e-12


def test_a_ds_gmr_is_conditioned_as_one_large_gaussian(ds_gmr):
    """The response of the mass to the attractor from unit attractors, one by one."""
    situation, still = frames([0.5, 0.3]), np.zeros(2)
    time, noise = TIME[:31], 1e-4 * np.eye(2)
    usual = ds_gmr.reproduce(situation, time, still, still)
    response = np.zeros((2, 62))
    for k in range(31):
        for i in range(2):
            unit = np.zeros((31, 2))
            unit[k, i] = 1.0
            moved = follow_attractor(unit, 0.02, still, still, ds_gmr.stiffness, ds_gmr.damping)
            response[:, 2 * k + i] = moved.position[20]
    slack = np.trace(usual.covariance, axis1=1, axis2=2).mean() / 2.0 * np.eye(2)
    values, axes = np.linalg.eigh(usual.covariance + slack)
    root = np.einsum("tij,tj,tkj->tik", axes, np.sqrt(values), axes)
    length = np.median(np.sqrt(ds_gmr.mixture_.covariances_[0][:, 0, 0]))
    kernel = np.exp(-0.5 * ((time[:, None] - time) / length) ** 2)
    joint = np.einsum("ts,tij,skj->tisk", kernel, root, root).reshape(62, 62)
    gain = np.linalg.solve(response @ joint @ response.T + noise, response @ joint)
    point = usual.position[20] + [0.02, -0.01]
    expected = usual.attractor + ((point - usual.position[20]) @ gain).reshape(31, 2)
    led = ds_gmr.condition(float(time[20]), point, noise)
    made = led.reproduce(situation, time, still, still)
    np.testing.assert_allclose(made.attractor, expected, atol=1e-8)


def test_via_points_of_a_ds_gmr_that_cannot_be_met_are_said(ds_gmr, tmp_path):
    situation, still = frames([0.5, 0.3]), np.zeros(2)
    for led, why in (
        (ds_gmr.condition(0.0, still), "must be after 0 s"),
        (ds_gmr.condition(3.0, still), "and by 2 s"),
        (ds_gmr.condition(1.0, still).condition(1.0, [0.1, 0.0]), "at the same instant"),
    ):
        with pytest.raises(ValueError, match=why):
            led.reproduce(situation, TIME, still, still)
    with pytest.raises(ValueError, match="are not saved"):
        led.save(tmp_path / "led.npz")
    with pytest.raises(ValueError, match="position must have length 2"):
        ds_gmr.reproduce(situation, TIME, still, still, end=[0.0])
