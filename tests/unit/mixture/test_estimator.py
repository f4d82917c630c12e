"""The estimators keep scikit-learn's conventions: its own checks say so, and they give what the
mixture and the regression give.
"""

import re
import subprocess
import sys
import warnings

import numpy as np
import pytest

from dart_skill.mixture import (
    GaussianMixture,
    GaussianMixtureEstimator,
    GaussianMixtureRegressor,
    Regression,
)
from tests.paths import DOCS
from tests.unit.mixture.random_mixture import whole

X = np.random.default_rng(3).normal(size=(120, 3)) + 4.0 * np.repeat(np.eye(3), 40, axis=0)
Y = X @ [1.0, -2.0, 0.5] + 0.1 * np.random.default_rng(4).normal(size=120)


@pytest.fixture
def checks():
    """scikit-learn's list of checks, if it is here: a list that says what came of each."""
    pytest.importorskip(
        "sklearn",
        "1.6",
        reason="scikit-learn >= 1.6 is needed: pip install -r requirements/test.txt",
    )
    return pytest.importorskip("sklearn.utils.estimator_checks").check_estimator


def not_kept() -> set[str]:
    """The checks that the table in docs/learning.md says do not apply."""
    return set(
        re.findall(
            r"^\| `(check_\w+)`", (DOCS / "learning.md").read_text(encoding="utf-8"), re.MULTILINE
        )
    )


@pytest.mark.parametrize("n_components", [1, 3])
@pytest.mark.parametrize("kind", [GaussianMixtureEstimator, GaussianMixtureRegressor])
def test_scikit_learn_finds_an_estimator_of_its_own_but_for_what_the_table_says(
    kind, n_components, checks
):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = checks(kind(n_components), on_fail=None, on_skip=None)
    failed = {one["check_name"]: one["exception"] for one in found if one["status"] == "failed"}
    assert len(found) > 40
    assert not (failed.keys() - not_kept()), failed
    if n_components > 1:  # the random start is one of more than one component
        assert failed.keys() == not_kept()


def test_scikit_learn_is_never_imported():
    script = "import sys, dart_skill.mixture, dart_skill.movement; print('sklearn' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "False"


def test_the_estimator_is_the_mixture():
    mine = GaussianMixture(3).fit(X, rng=np.random.default_rng(5))
    found = GaussianMixtureEstimator(3, random_state=5).fit(X)
    for ours, theirs in (
        (mine.priors_, found.weights_),
        (mine.means_, found.means_),
        (mine.covariances_, found.covariances_),
    ):
        assert np.array_equal(ours, theirs)
    assert np.array_equal(mine.log_density(X), found.score_samples(X)) and found.bic(
        X
    ) == mine.bic(X)
    assert (
        found.score(X) == pytest.approx(found.lower_bound_, abs=1e-6)
        and found.n_iter_ == mine.n_iterations_
    )
    assert found.aic(X) == pytest.approx(-2.0 * 120 * found.score(X) + 2.0 * (2 + 9 + 18))
    assert np.array_equal(found.predict(X), mine.responsibilities(X).argmax(1))
    assert (
        repr(found)
        == "GaussianMixtureEstimator(n_components=3, random_state=5): 3 components in 3 dimensions"
    )


def test_draws_have_the_moments_of_the_mixture():
    found = GaussianMixtureEstimator(3, random_state=0).fit(X)
    drawn, labels = found.sample(40_000)
    expected = whole(found.mixture_)
    assert np.allclose(drawn.mean(0), expected.mean, atol=0.05) and np.allclose(
        np.cov(drawn.T), expected.covariance, atol=0.12
    )
    assert (
        np.allclose(np.bincount(labels) / len(labels), found.weights_, atol=0.01)
        and (np.diff(labels) >= 0).all()
    )


def test_the_regressor_is_the_regression_and_has_its_score(checks):
    from sklearn.metrics import r2_score

    found = GaussianMixtureRegressor(2, random_state=1).fit(X[::2], Y[::2])
    mean, covariance = Regression(found.mixture_, [0, 1, 2], [3])(X[1::2])
    predicted, deviation = found.predict(X[1::2], return_std=True)
    assert np.array_equal(predicted, mean[:, 0]) and np.allclose(
        deviation, np.sqrt(covariance[:, 0, 0])
    )
    assert (
        found.score(X[1::2], Y[1::2]) == pytest.approx(r2_score(Y[1::2], predicted))
        and found.score(X, Y) > 0.95
    )
    both = np.column_stack([Y, np.full(len(Y), 2.0)])
    weight = np.arange(1.0, 121.0)
    found.fit(X, both)
    assert found.score(X, both, weight) == pytest.approx(
        r2_score(both, found.predict(X), sample_weight=weight)
    )
    with pytest.raises(ValueError, match="exclude each other"):
        found.predict(X, return_std=True, return_cov=True)


def test_a_search_over_parameters_finds_the_components(checks):
    from sklearn.base import clone
    from sklearn.model_selection import GridSearchCV
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    shuffled = np.random.default_rng(0).permutation(X)
    search = GridSearchCV(
        GaussianMixtureEstimator(random_state=0, n_init=3), {"n_components": [1, 3]}, cv=3
    ).fit(shuffled)
    assert search.best_params_ == {"n_components": 3}
    assert (
        make_pipeline(StandardScaler(), GaussianMixtureRegressor(2, random_state=0))
        .fit(X, Y)
        .score(X, Y)
        > 0.95
    )
    mixture = GaussianMixture(4, tolerance=1e-3).fit(X, rng=np.random.default_rng(0))
    copied = clone(mixture)
    assert copied.get_params() == mixture.get_params() and not hasattr(copied, "priors_")


def test_hyper_parameters_are_checked_where_they_are_set():
    mixture = GaussianMixture(4)
    assert (
        mixture.set_params(n_components=2, tolerance=1e-3) is mixture and mixture.n_components == 2
    )
    assert (
        mixture.get_params()["tolerance"] == 1e-3
        and repr(mixture) == "GaussianMixture(n_components=2, tolerance=0.001)"
    )
    with pytest.raises(
        ValueError, match="Invalid parameter 'tol' for GaussianMixture; it has n_components"
    ):
        mixture.set_params(tol=1.0)
    with pytest.raises(ValueError, match="n_components must be an integer"):
        mixture.set_params(n_components=0)
    with pytest.raises(ValueError, match="n_components must be an integer"):
        GaussianMixtureEstimator(n_components=0).fit(X)


def test_columns_with_names_are_those_of_the_fit():
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(X, columns=["x", "y", "z"])
    found = GaussianMixtureEstimator(random_state=0).fit(table)
    assert found.feature_names_in_.tolist() == ["x", "y", "z"]
    with pytest.raises(ValueError, match="those of the fit were"):
        found.predict(table[["y", "x", "z"]])
    assert not hasattr(found.fit(X), "feature_names_in_")


def test_what_is_not_fitted_says_so():
    for ask in (GaussianMixtureEstimator().predict, GaussianMixtureRegressor().predict):
        with pytest.raises(ValueError, match="not fitted yet; call fit first"):
            ask(X)
    assert not hasattr(GaussianMixtureEstimator(), "means_")


def test_without_scikit_learn_it_is_a_plain_error(monkeypatch):
    monkeypatch.delitem(sys.modules, "sklearn.exceptions", raising=False)
    with pytest.raises(ValueError) as caught:
        GaussianMixtureEstimator().score(X)
    assert type(caught.value) is ValueError
