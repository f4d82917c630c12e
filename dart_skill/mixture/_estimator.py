"""Mixture and regression with the interface of scikit-learn's estimators, which is not imported:
only its conventions are kept.

`GaussianMixture` is a mixture: it can be made from parameters, conditioned and saved.
These two are what pipelines, searches over parameters and cross-validation of scikit-learn take.
They are thin: `mixture_` does the work.

Names are those of scikit-learn (weights_, tol, random_state). (7.21) and the rest of this package
say priors, tolerance and rng.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_learnable, as_samples, as_weights, unmasked
from dart_skill.common.hyper_parameters import HyperParameters
from dart_skill.mixture._mixture import GaussianMixture
from dart_skill.mixture._regression import Regression


class _Estimator(HyperParameters):
    """What both have in common: hyper-parameters of EM, checks of X, and what scikit-learn asks of
    an estimator.
    """

    _estimator_type: str

    def __init__(
        self,
        n_components: int = 1,
        *,
        covariance_floor: float = 1e-6,
        tol: float = 1e-6,
        max_iter: int = 300,
        n_init: int = 1,
        covariance_prior: float = 0.0,
        random_state: Any = None,
    ) -> None:
        self.n_components, self.covariance_floor = n_components, covariance_floor
        self.covariance_prior = covariance_prior
        self.tol, self.max_iter, self.n_init, self.random_state = (
            tol,
            max_iter,
            n_init,
            random_state,
        )

    def _fit_mixture(self, samples: np.ndarray, sample_weight: ArrayLike | None) -> None:
        weights = as_weights(
            None if sample_weight is None else np.asarray(unmasked(sample_weight)),
            len(samples),
            "sample_weight",
        )
        mixture = GaussianMixture(
            self.n_components,
            covariance_floor=self.covariance_floor,
            tolerance=self.tol,
            max_iterations=self.max_iter,
            n_starts=self.n_init,
            covariance_prior=self.covariance_prior,
        )
        self.mixture_ = mixture.fit(
            as_learnable(samples, "X"), weights, rng=_generator(self.random_state)
        )
        self.converged_, self.n_iter_ = mixture.converged_, mixture.n_iterations_

    def _remember_columns(self, X: Any, table: np.ndarray) -> None:
        names = _names(X)
        if names is not None:
            self.feature_names_in_ = names
        elif hasattr(self, "feature_names_in_"):
            del self.feature_names_in_
        self.n_features_in_ = table.shape[1]

    def _checked(self, X: Any) -> np.ndarray:
        """X (n, d) of a fitted estimator; ValueError unless it has the columns of the fit."""
        self._require_fitted()
        table, names = _as_table(X, "X"), _names(X)
        if table.shape[1] != self.n_features_in_:
            expecting = (
                f"{type(self).__name__} is expecting {self.n_features_in_} features as input"
            )
            raise ValueError(
                f"X has {table.shape[1]} features, but {expecting}; give the columns of the fit"
            )
        if (
            names is not None
            and hasattr(self, "feature_names_in_")
            and names.tolist() != self.feature_names_in_.tolist()
        ):
            raise ValueError(
                f"the columns of X are {names.tolist()}, and those of the fit were"
                f" {self.feature_names_in_.tolist()}"
            )
        return table

    def _require_fitted(self) -> None:
        if not hasattr(self, "mixture_"):
            # Code that catches scikit-learn's own error has loaded it, and it is a ValueError, too.
            kind = getattr(sys.modules.get("sklearn.exceptions"), "NotFittedError", ValueError)
            raise kind(f"this {type(self).__name__} is not fitted yet; call fit first")

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "mixture_")

    def _fitted_to(self) -> str:
        return self.mixture_._fitted_to() if hasattr(self, "mixture_") else ""

    def __sklearn_tags__(self) -> Any:
        """What scikit-learn asks for; only it does, so it is loaded."""
        utils = sys.modules["sklearn.utils"]
        is_regressor = self._estimator_type == "regressor"
        return utils.Tags(
            estimator_type=self._estimator_type,
            target_tags=utils.TargetTags(
                required=is_regressor, multi_output=is_regressor, two_d_labels=False
            ),
            regressor_tags=utils.RegressorTags() if is_regressor else None,
        )


class GaussianMixtureEstimator(_Estimator):
    """`GaussianMixture` with the interface of scikit-learn's: full covariances, fitted by EM to X
    (n, d).

    After `fit`:

    Parameters
    ----------
    n_components
        Int, default 1. Number K of components at the start; a fit may end with fewer.
    covariance_floor
        Float, default 1e-6. Least variance of a component, relative to that of each column;
        scikit-learn's reg_covar is absolute.
    tol
        Float, default 1e-6. EM stops when the mean log-likelihood per sample changes by no more
        than this.
    max_iter
        Int, default 300. EM stops after so many iterations in any case.
    n_init
        Int, default 1. Number of runs with different random starts; the most likely result is
        kept.
    covariance_prior
        Float, default 0. For few samples: weight of a prior on the covariances, in samples; as of
        `GaussianMixture`.
    random_state
        None (another start each time), a seed, a numpy Generator or a RandomState.

    Attributes
    ----------
    mixture_
        The fitted GaussianMixture, with marginals and `save`.
    weights_ : (K,)
        Its parameters.
    means_ : (K, d)
        Its parameters.
    covariances_ : (K, d, d)
        Its parameters.
    converged_, n_iter_
        How EM ended.
    lower_bound_
        Float, mean log-likelihood per sample; weighted.
    n_features_in_
        d.
    feature_names_in_
        Names of the columns, if X was a table that has them.
    """

    _estimator_type = "density_estimator"

    def fit(
        self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None
    ) -> GaussianMixtureEstimator:
        """Fit to X (n, d)

        Parameters
        ----------
        y
            Not looked at, as in every estimator of scikit-learn without a target.
        sample_weight
            (n,), default None: all count alike. A weight of two counts as two equal samples.

        Returns
        -------
        GaussianMixtureEstimator
            Self.

        Raises
        ------
        ValueError
            As of `GaussianMixture.fit`.
        """
        table = _as_table(X, "X")
        self._fit_mixture(table, sample_weight)
        self._remember_columns(X, table)
        mixture = self.mixture_
        self.weights_, self.means_ = mixture.priors_, mixture.means_
        self.covariances_ = mixture.covariances_
        self.lower_bound_ = self.mixture_.log_likelihood_ / float(
            as_weights(sample_weight, len(table), "sample_weight").sum()
        )
        return self

    def fit_predict(
        self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None
    ) -> np.ndarray:
        """`fit`, and the component of each of the samples (n,).

        Parameters
        ----------
        X, y, sample_weight
            As of `fit`.
        """
        return self.fit(X, y, sample_weight).predict(X)

    def score_samples(self, X: ArrayLike) -> np.ndarray:
        """Log density (n,) of the samples X (n, d), (3.2)."""
        table = self._checked(X)
        return self.mixture_.log_density(table)

    def score(
        self, X: ArrayLike, y: object = None, sample_weight: ArrayLike | None = None
    ) -> float:
        """Mean log density of the samples X (n, d): higher is better.

        Parameters
        ----------
        y
            Not looked at.
        sample_weight
            (n,), default None: equal.
        """
        log_density = self.score_samples(X)
        return float(
            np.average(
                log_density, weights=as_weights(sample_weight, len(log_density), "sample_weight")
            )
        )

    def predict_proba(self, X: ArrayLike) -> np.ndarray:
        """(n, K) posterior probability of each component for samples X (n, d)."""
        table = self._checked(X)
        return self.mixture_.responsibilities(table)

    def predict(self, X: ArrayLike) -> np.ndarray:
        """(n,) index of the most probable component for samples X (n, d)."""
        return self.predict_proba(X).argmax(axis=1)

    def sample(self, n_samples: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Draws (n_samples, d), ordered by component, and the components (n_samples,) that they
        came from.
        """
        self._require_fitted()
        rng, mixture = _generator(self.random_state), self.mixture_
        counts = rng.multinomial(n_samples, mixture.priors_)
        labels = np.repeat(np.arange(len(counts)), counts)
        factors = np.linalg.cholesky(mixture.covariances_)
        noise = rng.standard_normal((len(labels), mixture.n_dims))
        return mixture.means_[labels] + np.einsum("nij,nj->ni", factors[labels], noise), labels

    def bic(self, X: ArrayLike) -> float:
        """Bayesian information criterion for samples X (n, d): lower is better."""
        table = self._checked(X)
        return self.mixture_.bic(table)

    def aic(self, X: ArrayLike) -> float:
        """Akaike's information criterion for samples X (n, d): lower is better."""
        table = self._checked(X)
        return self.mixture_.aic(table)


class GaussianMixtureRegressor(_Estimator):
    """Gaussian mixture regression (3.3) to (3.5) with the interface of scikit-learn's regressors:
    a mixture of X and y together.

    After `fit`:

    Parameters
    ----------
    n_components
        Int, default 1. Number K of components at the start.
    covariance_floor, tol, max_iter, n_init, covariance_prior, random_state
        As of `GaussianMixtureEstimator`.

    Attributes
    ----------
    mixture_
        The fitted GaussianMixture over the columns of X, then those of y.
    converged_, n_iter_
        How EM ended.
    n_features_in_
        The number of columns of X.
    feature_names_in_
        Their names, if X was a table that has them.
    """

    _estimator_type = "regressor"

    def fit(
        self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None
    ) -> GaussianMixtureRegressor:
        """Fit to inputs X (n, d) and outputs y, (n,) or (n, o)

        Parameters
        ----------
        sample_weight
            (n,), default None: all count alike.

        Returns
        -------
        GaussianMixtureRegressor
            Self.

        Raises
        ------
        ValueError
            For values of another shape, and as of `GaussianMixture.fit`.
        """
        if y is None:
            raise ValueError(
                "requires y to be passed, but the target y is None; give the outputs that belong"
                " to X"
            )
        inputs, outputs = _as_table(X, "X"), _as_outputs(y)
        if len(inputs) != len(outputs):
            raise ValueError(f"X and y must be as long, got {len(inputs)} and {len(outputs)} rows")
        self._fit_mixture(np.column_stack([inputs, outputs]), sample_weight)
        self._remember_columns(X, inputs)
        self._flat = outputs.ndim == 1
        d = inputs.shape[1]
        self._regression = Regression(
            self.mixture_, np.arange(d), np.arange(d, self.mixture_.n_dims)
        )
        return self

    def predict(self, X: ArrayLike, return_std: bool = False, return_cov: bool = False) -> Any:
        """Mean of the outputs for inputs X (n, d), in the shape of the y of the fit: (n,) or (n,
        o).

        Parameters
        ----------
        return_std
            With it a pair, the mean and the standard deviations of its shape.
        return_cov
            With it a pair, the mean and the covariances (n, o, o) of the outputs; of each input by
            itself.

        Raises
        ------
        ValueError
            If both are asked for.
        """
        if return_std and return_cov:
            raise ValueError("return_std and return_cov exclude each other; ask for one of them")
        table = self._checked(X)
        if not (return_std or return_cov):
            return self._shaped(self._regression.mean(table))
        mean, covariance = self._regression(table)
        return self._shaped(mean), (
            covariance if return_cov else self._shaped(np.sqrt(np.einsum("nii->ni", covariance)))
        )

    def _shaped(self, outputs: np.ndarray) -> np.ndarray:
        return outputs[:, 0] if self._flat else outputs

    def score(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
        """Coefficient of determination R^2 of `predict`, the mean over the outputs: 1 is best, 0
        is no better than a constant.

        Parameters
        ----------
        X : (n, d)
            Inputs, and outputs as of `fit`.
        y
            Inputs, and outputs as of `fit`.
        sample_weight
            (n,), default None: equal.
        """
        predicted, given = self.predict(X), _as_outputs(y)
        weights = as_weights(sample_weight, len(given), "sample_weight")
        left = weights @ np.square(given - predicted)
        varies = weights @ np.square(given - np.average(given, axis=0, weights=weights))
        shares = np.where(
            varies > 0,
            1.0 - left / np.where(varies > 0, varies, 1.0),
            np.where(left > 0, 0.0, 1.0),
        )
        return float(np.mean(shares))


def _generator(random_state: Any) -> np.random.Generator:
    """A generator of what scikit-learn calls random_state."""
    if isinstance(random_state, np.random.RandomState):
        return np.random.default_rng(random_state.randint(2**32, size=4, dtype=np.uint32))
    return np.random.default_rng(random_state)


def _names(X: Any) -> np.ndarray | None:
    """Names of the columns of a table, if all of them are texts."""
    columns = getattr(X, "columns", None)
    if columns is None or not all(isinstance(one, str) for one in columns):
        return None
    return np.array(list(columns), dtype=object)


def _plain(value: Any, name: str) -> np.ndarray:
    """An array of real numbers; ValueError for sparse and complex ones. Those words are what
    scikit-learn's own checks look for.
    """
    if hasattr(value, "toarray"):
        raise ValueError(
            f"{name} is sparse, and Sparse data was passed where dense data is required; use"
            f" {name}.toarray()"
        )
    array = np.asarray(unmasked(value))
    if np.iscomplexobj(array):
        raise ValueError(f"Complex data not supported: {name} has complex numbers; give real ones")
    return array


def _as_table(X: Any, name: str) -> np.ndarray:
    """X (n, d) of finite numbers; ValueError for what is none."""
    array = _plain(X, name)
    if array.ndim < 2:
        raise ValueError(
            f"{name} must have two dimensions (n, d), got shape {array.shape}. Reshape your data:"
            " reshape(-1, 1) for one column, reshape(1, -1) for one sample"
        )
    for axis, what in enumerate(("sample(s)", "feature(s)")):
        if array.shape[axis] == 0:
            raise ValueError(
                f"{name} has 0 {what} (shape={array.shape}) while a minimum of 1 is required."
            )
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        what = "NaN" if np.isnan(array).any() else "infinity"
        raise ValueError(f"{name} contains {what}; remove or interpolate such values first")
    return as_samples(array, name)


def _as_outputs(y: Any) -> np.ndarray:
    """Outputs (n,) or (n, o) of finite numbers; ValueError for what is none."""
    array = _plain(y, "y")
    return _as_table(array, "y") if array.ndim != 1 else _as_table(array[:, None], "y")[:, 0]
