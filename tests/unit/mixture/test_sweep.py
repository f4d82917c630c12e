"""The fast iteration of EM against the plain one: Cholesky factors and deviations, component by
component.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dart_skill.mixture import GaussianMixture, Parameters, Sweep, expectation, maximisation
from tests.interpreted import interpreted

FLOOR = 1e-6
SLICE = 4096
"""Number of samples that are gone through at a time."""
KEPT = 4 * SLICE
"""Number of samples up to which products are kept."""
LARGEST_LOSS = 1e-10
"""Largest error of a log density."""
LOSS_SHARE = 1e-4
"""The same as a share of the tolerance."""


def responsibilities_of_neighbours(rng, samples, n_components):
    """Soft and overlapping, around random samples."""
    centres = samples[rng.choice(len(samples), n_components, replace=False)]
    shares = np.exp(-0.5 * np.square(samples[:, None] - centres).sum(2)) + 1e-3
    return shares / shares.sum(1, keepdims=True)


def one_iteration(blocks, weights, parameters, path="automatic", floor=FLOOR, tolerance=0.0):
    """Log densities of the E step and the parameters of the M step by a sweep, in the units of the
    blocks.
    """
    sweep = Sweep(blocks, weights, floor, tolerance)
    components = sweep.to_white(parameters.means, parameters.covariances)
    if path == "automatic":
        sums = sweep(parameters.priors, components)
    else:
        sums = getattr(sweep, path)(np.log(parameters.priors), components)
    return sums.log_density, Parameters(
        sums.mass / sums.mass.sum(), *sweep.from_white(sweep.maximise(sums))
    )


def plain_iteration(blocks, weights, parameters, floor=FLOOR):
    shares, log_density = expectation(blocks, parameters)
    return log_density, maximisation(blocks, shares * weights[:, None], floor)


def largest_difference(found, expected):
    """Of log densities, priors, and means and covariances in units of the deviations of each
    component.
    """
    differences = [
        np.abs(found[0] - expected[0]).max(),
        np.abs(found[1].priors - expected[1].priors).max(),
    ]
    for one, other, covariance, other_covariance in zip(
        found[1].means,
        expected[1].means,
        found[1].covariances,
        expected[1].covariances,
        strict=True,
    ):
        deviation = np.sqrt(np.diagonal(other_covariance, axis1=1, axis2=2))
        differences.append((np.abs(one - other) / deviation).max())
        scale = deviation[:, :, None] * deviation[:, None, :]
        differences.append((np.abs(covariance - other_covariance) / scale).max())
    return max(differences)


def least_rounding(parameters):
    """What rounding must do to the log density of a sample as far out as the component is long:
    eps times the condition.
    """
    return np.finfo(float).eps * max(
        np.linalg.cond(covariances).max() for covariances in parameters.covariances
    )


def standardised(samples):
    deviation = samples.std(0)
    return (samples - samples.mean(0)) / np.where(deviation > 1e-12, deviation, 1.0)


def cases():
    rng = np.random.default_rng(0)
    base = rng.normal(size=(700, 4)) * [1.0, 2.0, 0.5, 1.0] + 3 * rng.integers(0, 3, (700, 1))
    time = np.tile(np.linspace(0, 1, 100), 7)
    motion = np.column_stack(
        [time, np.sin(3 * time), np.cos(3 * time), time**2]
    ) + 1e-3 * rng.normal(size=(700, 4))
    narrow = np.concatenate(
        [rng.normal(size=(400, 3)), [5.0, -5.0, 5.0] + 1e-3 * rng.normal(size=(300, 3))]
    )
    return {
        "clusters": base,
        "collinear": np.column_stack([base, base @ [1.0, -2.0, 0.5, 0.0]]),
        "nearly collinear": np.column_stack([base, base[:, 0] + 1e-4 * rng.normal(size=700)]),
        "constant column": np.column_stack([base, np.full(700, 0.0)]),
        "motion with little noise": motion,
        "one narrow component": narrow,
        "outlier": np.vstack([base, np.full((1, 4), 1e4)]),
        "one column": base[:, :1],
        "twelve columns": rng.normal(size=(700, 12)) @ rng.normal(size=(12, 12)),
    }


@pytest.mark.parametrize("case", cases())
def test_an_iteration_is_the_plain_one(case):
    rng = np.random.default_rng(1)
    samples = standardised(cases()[case])
    weights = rng.random(len(samples))
    parameters = maximisation([samples], responsibilities_of_neighbours(rng, samples, 3), FLOOR)
    for iteration in range(8):
        expected = plain_iteration([samples], weights, parameters)
        found = one_iteration([samples], weights, parameters)
        allowed = LARGEST_LOSS + least_rounding(parameters)
        assert largest_difference(found, expected) < allowed, (
            case,
            iteration,
            largest_difference(found, expected),
            allowed,
        )
        parameters = expected[1]


@pytest.mark.parametrize("case", cases())
def test_an_iteration_is_the_plain_one_as_far_as_its_tolerance_asks(case):
    """Where EM stops early, products are exact enough sooner: they take a fraction of the time."""
    rng, tolerance = np.random.default_rng(1), 1e-3
    samples = standardised(cases()[case])
    weights = rng.random(len(samples))
    parameters = maximisation([samples], responsibilities_of_neighbours(rng, samples, 3), FLOOR)
    for _ in range(8):
        expected = plain_iteration([samples], weights, parameters)
        found = one_iteration([samples], weights, parameters, tolerance=tolerance)
        allowed = LOSS_SHARE * tolerance + least_rounding(parameters)
        assert largest_difference(found, expected) < allowed, (
            case,
            largest_difference(found, expected),
            allowed,
        )
        parameters = expected[1]


@given(seed=st.integers(0, 10_000), n_dims=st.integers(1, 6), n_components=st.integers(1, 5))
@settings(max_examples=40, deadline=None)
def test_both_ways_through_the_samples_agree(seed, n_dims, n_components):
    rng = np.random.default_rng(seed)
    samples = standardised(rng.normal(size=(200, n_dims)) @ rng.normal(size=(n_dims, n_dims)))
    weights = rng.random(200)
    parameters = maximisation(
        [samples], responsibilities_of_neighbours(rng, samples, n_components), FLOOR
    )
    by_products = one_iteration([samples], weights, parameters, "by_products")
    by_deviations = one_iteration([samples], weights, parameters, "by_deviations")
    assert largest_difference(by_products, by_deviations) < 1e-8
    assert largest_difference(one_iteration([samples], weights, parameters), by_deviations) < 1e-9


def test_a_narrow_component_far_out_is_not_left_to_products():
    """Here products lose digits, which is why the sweep looks before it chooses."""
    samples = standardised(cases()["one narrow component"])
    shares = np.column_stack([np.arange(700) < 400, np.arange(700) >= 400]).astype(float)
    parameters, weights = maximisation([samples], shares, FLOOR), np.ones(700)
    expected = plain_iteration([samples], weights, parameters)
    lost = largest_difference(
        one_iteration([samples], weights, parameters, "by_products"), expected
    )
    kept = largest_difference(one_iteration([samples], weights, parameters), expected)
    assert lost > 1e-10 > kept, (lost, kept)


@pytest.mark.parametrize(
    "n_samples", [SLICE - 1, SLICE, SLICE + 1, KEPT, KEPT + 1, KEPT + 2, KEPT + 3]
)
@pytest.mark.parametrize("path", ["by_products", "by_deviations"])
def test_slices_leave_no_seam(n_samples, path):
    rng = np.random.default_rng(2)
    samples, weights = standardised(rng.normal(size=(n_samples, 2))), rng.random(n_samples)
    parameters = maximisation([samples], responsibilities_of_neighbours(rng, samples, 2), FLOOR)
    found = one_iteration([samples], weights, parameters, path)
    assert largest_difference(found, plain_iteration([samples], weights, parameters)) < 1e-11


@pytest.mark.parametrize("path", ["by_products", "by_deviations"])
def test_blocks_of_different_width_share_their_responsibilities(path):
    rng = np.random.default_rng(3)
    samples = standardised(cases()["clusters"])
    blocks, weights = [samples[:, :3], samples[:, 2:], samples[:, :1]], rng.random(700)
    parameters = maximisation(blocks, responsibilities_of_neighbours(rng, samples, 3), FLOOR)
    found = one_iteration(blocks, weights, parameters, path)
    assert largest_difference(found, plain_iteration(blocks, weights, parameters)) < 1e-10


@pytest.mark.parametrize("path", ["by_products", "by_deviations"])
def test_samples_that_a_block_does_not_see_add_nothing_there(path):
    rng = np.random.default_rng(6)
    samples = standardised(cases()["clusters"])
    blocks, weights = [samples[:, :3].copy(), samples[:, 2:].copy()], rng.random(700)
    blocks[0][:200], blocks[1][500:] = np.nan, np.nan
    parameters = maximisation(blocks, responsibilities_of_neighbours(rng, samples, 3), FLOOR)
    log_density, found = one_iteration(blocks, weights, parameters, path)
    assert (
        largest_difference((log_density, found), plain_iteration(blocks, weights, parameters))
        < 1e-10
    )
    alone = Parameters(parameters.priors, parameters.means[1:], parameters.covariances[1:])
    np.testing.assert_allclose(
        log_density[:200], expectation([samples[:200, 2:]], alone)[1], atol=1e-11
    )


@pytest.mark.parametrize("path", ["by_products", "by_deviations"])
def test_a_component_that_a_block_does_not_see_is_as_wide_there_as_all(path):
    rng = np.random.default_rng(7)
    samples = standardised(
        np.concatenate([rng.normal(-4.0, 1.0, (300, 2)), rng.normal(4.0, 1.0, (300, 2))])
    )
    blocks, weights = (
        [samples, np.where(np.arange(600)[:, None] < 300, np.nan, samples)],
        rng.random(600),
    )
    parameters = maximisation(blocks, np.repeat(np.eye(2), 300, axis=0), FLOOR)
    found = one_iteration(blocks, weights, parameters, path)
    assert largest_difference(found, plain_iteration(blocks, weights, parameters)) < 1e-10
    seen, its_weights = samples[300:], weights[300:]
    np.testing.assert_allclose(
        found[1].means[1],
        np.tile(np.average(seen, axis=0, weights=its_weights), (2, 1)),
        atol=1e-4,
    )
    np.testing.assert_allclose(
        found[1].covariances[1][0], np.cov(seen.T, aweights=its_weights, bias=True), atol=1e-10
    )


@pytest.mark.parametrize("floor", [1e-6, 1e-2, 0.3])
def test_the_floor_is_that_of_the_plain_step(floor):
    rng = np.random.default_rng(4)
    samples, weights = standardised(cases()["motion with little noise"]), np.ones(700)
    parameters = maximisation([samples], responsibilities_of_neighbours(rng, samples, 5), floor)
    found = one_iteration([samples], weights, parameters, floor=floor)
    assert np.linalg.eigvalsh(found[1].covariances[0]).min() > floor * (1 - 1e-9)
    assert largest_difference(found, plain_iteration([samples], weights, parameters, floor)) < 1e-9


@pytest.mark.parametrize("margin", [0.5, 1.0 - 1e-6, 1.0 + 1e-6, 30.0])
def test_the_least_eigenvalue_of_all_decides_whether_components_are_above_the_floor(margin):
    """In the units of the block, in which no column is like another; far above it a bound decides,
    near it the eigenvalues.
    """
    rng = np.random.default_rng(7)
    samples = rng.normal(size=(300, 4)) @ rng.normal(size=(4, 4))
    blocks = Sweep([samples], np.ones(300), FLOOR).blocks[0]
    axes, least = (
        np.linalg.qr(rng.normal(size=(3, 4, 4)))[0],
        FLOOR * np.array([margin, 40.0, 90.0]),
    )
    covariances = np.einsum("kij,kj,klj->kil", axes, least[:, None] * [1.0, 1.2, 3.0, 1e3], axes)
    assert blocks.are_above_floor(blocks.to_white(np.zeros((1, 3, 4)), covariances[None])) == (
        margin > 1.0
    )


def test_fifty_iterations_stay_with_the_plain_ones():
    rng = np.random.default_rng(5)
    samples, weights = standardised(cases()["clusters"]), rng.random(700) + 0.1
    start = maximisation([samples], responsibilities_of_neighbours(rng, samples, 4), FLOOR)
    plain = start
    for _ in range(50):
        plain = plain_iteration([samples], weights, plain)[1]
    first = GaussianMixture.from_parameters(start.priors, start.means[0], start.covariances[0])
    fit = GaussianMixture(4, covariance_floor=FLOOR, tolerance=0.0, max_iterations=50)
    fit.fit(samples, weights, start=first)
    assert fit.n_iterations_ == 50
    log_density = expectation([samples], plain)[1]
    found = Parameters(fit.priors_, [fit.means_], [fit.covariances_])
    assert largest_difference((log_density, found), (log_density, plain)) < 1e-8
    assert fit.log_likelihood_ == pytest.approx(weights @ log_density, rel=1e-12)


@pytest.mark.parametrize("case", ["clusters", "collinear"])
def test_the_m_step_of_given_counts_is_the_plain_one(case):
    rng, samples = np.random.default_rng(12), standardised(cases()[case])
    blocks, weights = [samples, samples[:, :2]], rng.random(700) + 0.1
    counts = responsibilities_of_neighbours(rng, samples, 3) * weights[:, None]
    sweep = Sweep(blocks, weights, FLOOR)
    sums = sweep.sums_of(counts)
    found = Parameters(sums.mass / sums.mass.sum(), *sweep.from_white(sweep.maximise(sums)))
    expected, nothing = maximisation(blocks, counts, FLOOR), np.zeros(1)
    difference = largest_difference((nothing, found), (nothing, expected))
    assert difference < LARGEST_LOSS + least_rounding(expected)


def test_compiled_and_interpreted_have_the_same_bits(monkeypatch):
    rng, samples = np.random.default_rng(13), standardised(cases()["clusters"])
    blocks, weights = [samples, samples[:, 1:3]], rng.random(700)
    parameters = maximisation(blocks, responsibilities_of_neighbours(rng, samples, 3), FLOOR)
    compiled = one_iteration(blocks, weights, parameters)
    plain = interpreted("dart_skill.mixture._second_moments")
    for name in ("write_components", "write_coefficients"):
        monkeypatch.setattr(f"dart_skill.mixture._sweep.{name}", getattr(plain, name))
    log_density, found = one_iteration(blocks, weights, parameters)
    np.testing.assert_array_equal(log_density, compiled[0])
    for one, other in zip(found.covariances, compiled[1].covariances, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_fit_of_many_samples_needs_little_more_memory_than_the_samples():
    import tracemalloc

    rng = np.random.default_rng(6)
    samples = np.concatenate([rng.normal(centre, 1.0, (15_000, 4)) for centre in (0.0, 3.0)])
    start = GaussianMixture(2).fit(samples[::100], rng=rng)
    tracemalloc.start()
    try:
        GaussianMixture(2, max_iterations=3).fit(samples, start=start)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 8 * samples.nbytes, f"{peak / samples.nbytes:.1f} times the samples"


@pytest.mark.parametrize("path", ["by_products", "by_deviations"])
def test_a_sample_that_is_too_far_out_for_its_density_counts_as_in_the_plain_iteration(path):
    """Its density is e^-10000 and less, which is zero; its responsibilities are not."""
    rng = np.random.default_rng(5)
    samples = np.concatenate(
        [
            rng.normal(size=(400, 2)) * 0.01 + [0.0, 1.0],
            rng.normal(size=(400, 2)) * 0.01 - [0.0, 1.0],
            [[2.0, 0.3]],
        ]
    )
    weights, covariances = np.ones(801), np.stack([1e-4 * np.eye(2)] * 2)
    parameters = Parameters(
        np.array([0.4, 0.6]), [np.array([[0.0, 1.0], [0.0, -1.0]])], [covariances]
    )
    found, expected = (
        one([samples], weights, parameters, *more)
        for one, more in ((one_iteration, (path,)), (plain_iteration, ()))
    )
    assert (
        expected[0].min() < -10_000
        and largest_difference(found, expected) < 1e-9 * -expected[0].min()
    )
    assert np.abs(found[0][:800] - expected[0][:800]).max() < 1e-9


def test_a_peak_of_one_block_is_not_the_highest_of_a_sample_that_it_does_not_see():
    """A wide component: its density is far below one everywhere, but the block says nothing of
    half of the samples.
    """
    rng = np.random.default_rng(6)
    wide, other = 1e50 * rng.normal(size=(300, 1)), rng.normal(size=(300, 1))
    wide[150:] = np.nan
    blocks, weights = [wide, other], np.ones(300)
    shares = rng.dirichlet([1.0, 1.0], 300)
    parameters = maximisation(blocks, shares, FLOOR)
    found, expected = (
        one_iteration(blocks, weights, parameters, "by_products"),
        plain_iteration(blocks, weights, parameters),
    )
    assert np.isfinite(found[0]).all() and largest_difference(found, expected) < 1e-8


def test_what_is_kept_is_gone_through_in_parts_with_the_same_result():
    """Many columns: their products are too many for one part."""
    rng = np.random.default_rng(8)
    samples, weights = (
        standardised(rng.normal(size=(2000, 12)) + rng.integers(0, 2, (2000, 1))),
        np.ones(2000),
    )
    parameters = maximisation([samples], responsibilities_of_neighbours(rng, samples, 3), FLOOR)
    assert len(Sweep([samples], weights, FLOOR).spans) > 1
    assert (
        largest_difference(
            one_iteration([samples], weights, parameters),
            plain_iteration([samples], weights, parameters),
        )
        < 1e-10
    )


def test_the_m_step_of_equally_wide_blocks_is_that_of_each():
    """To the last bit, also where a component has no count in one of them, or is below the floor
    there.
    """
    rng = np.random.default_rng(9)
    samples = standardised(cases()["clusters"])
    blocks, weights = [samples[:, :3], samples[:, 1:4]], rng.random(700)
    parameters = maximisation(blocks, responsibilities_of_neighbours(rng, samples, 3), FLOOR)
    sweep, each = (
        Sweep(blocks, weights, FLOOR),
        [Sweep([block], weights, FLOOR) for block in blocks],
    )
    products = sweep(
        parameters.priors, sweep.to_white(parameters.means, parameters.covariances)
    ).products[0]
    without_count, flat = products.copy(), products.copy()
    without_count[1, 2] *= 1e-12
    flat[0, 1] = flat[0, 1, 0] * np.diag([1.0, 1.0, 1e-14, 1.0])[np.triu_indices(4)]
    for changed, origin in (
        (products, None),
        (without_count, None),
        (flat, None),
        (flat, rng.normal(size=(2, 3, 3))),
    ):
        found = sweep.blocks[0].maximise(origin, changed)
        for j, alone in enumerate(each):
            expected = alone.blocks[0].maximise(
                None if origin is None else origin[j : j + 1], changed[j : j + 1]
            )
            for one, other in zip(found, expected, strict=True):
                np.testing.assert_array_equal(one[j : j + 1], other)


def test_the_m_step_of_a_component_without_any_count_in_a_block_does_not_divide_by_zero():
    rng = np.random.default_rng(10)
    sweep = Sweep([rng.normal(size=(50, 2))] * 2, np.ones(50), FLOOR)
    products = np.tile(20.0 * np.eye(3)[np.triu_indices(3)], (2, 2, 1))
    products[1, 0] = 0.0
    found = sweep.blocks[0].maximise(None, products)
    np.testing.assert_array_equal(found.means[1, 0], np.zeros(2))
    np.testing.assert_allclose(found.whiteners[1, 0], np.eye(2), atol=1e-12)


def test_products_that_blocks_have_in_common_are_stored_once():
    """Those of columns that are the same, or are sums of earlier columns; the results are those of
    blocks that share nothing.
    """
    rng = np.random.default_rng(11)
    first = rng.normal(size=(400, 4))
    second = np.column_stack(
        [first[:, 0], first[:, 1] - 3.0 * first[:, 0] + 2.0, rng.normal(size=(400, 2))]
    )
    weights = rng.random(400)
    sweep = Sweep([first, second], weights, FLOOR)
    assert (sweep.blocks[0].n_alike, sweep.n_rows) == (3, 1 + 15 + 15 - 6)
    shares = responsibilities_of_neighbours(rng, first, 3)
    found = one_iteration([first, second], weights, maximisation([first, second], shares, FLOOR))
    expected = plain_iteration(
        [first, second], weights, maximisation([first, second], shares, FLOOR)
    )
    assert largest_difference(found, expected) < 1e-10


def test_blocks_that_do_not_see_the_same_samples_have_no_products_in_common():
    rng = np.random.default_rng(12)
    first = rng.normal(size=(100, 3))
    second = first.copy()
    second[:10] = np.nan
    assert Sweep([first, second], np.ones(100), FLOOR).blocks[0].n_alike == 0
    assert Sweep([first, first], np.ones(100), FLOOR).n_rows == 1 + 10
