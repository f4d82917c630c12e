"""Gaussian mixtures: algebra of Gaussians (thesis table 3.1), weighted EM (3.2.1), regression
(3.2.2), number of components, split and merge (5.3), data spectroscopy (5.4), likelihood of
weighted data (6.4).
"""

from dart_skill.mixture._estimator import GaussianMixtureEstimator, GaussianMixtureRegressor
from dart_skill.mixture._expectation_maximisation import (
    Parameters,
    column_scales,
    expectation,
    expectation_at,
    in_units,
    masses_of,
    maximisation,
    normalise_log,
    with_prior,
)
from dart_skill.mixture._gaussian import (
    Gaussian,
    cholesky,
    linear_combination,
    product,
    product_of_gaussians,
    raise_to_floor,
    symmetric,
)
from dart_skill.mixture._mixture import (
    EMEstimator,
    GaussianMixture,
    checked_priors,
    n_free_parameters,
    require_enough,
)
from dart_skill.mixture._regression import Regression, regress, regress_each
from dart_skill.mixture._selection import (
    Selection,
    best_number,
    mean_log_likelihood,
    resampled_mean_log_likelihood,
    select_by_bic,
    select_by_cross_validation,
    stochastic_universal_sampling,
)
from dart_skill.mixture._spectroscopy import Spectroscopy, automatic_bandwidth, data_spectroscopy
from dart_skill.mixture._split_merge import Adapted, SplitMerge, adapt, split, split_and_merge
from dart_skill.mixture._start import kmeans_start, sliced_start
from dart_skill.mixture._sweep import DEAD_SHARE, Sweep

__all__ = [
    "Adapted",
    "DEAD_SHARE",
    "EMEstimator",
    "Gaussian",
    "GaussianMixture",
    "GaussianMixtureEstimator",
    "GaussianMixtureRegressor",
    "Parameters",
    "Regression",
    "Selection",
    "Spectroscopy",
    "SplitMerge",
    "adapt",
    "automatic_bandwidth",
    "best_number",
    "checked_priors",
    "cholesky",
    "column_scales",
    "data_spectroscopy",
    "Sweep",
    "expectation",
    "expectation_at",
    "in_units",
    "kmeans_start",
    "linear_combination",
    "masses_of",
    "maximisation",
    "mean_log_likelihood",
    "n_free_parameters",
    "normalise_log",
    "product",
    "product_of_gaussians",
    "raise_to_floor",
    "regress",
    "regress_each",
    "require_enough",
    "resampled_mean_log_likelihood",
    "select_by_bic",
    "select_by_cross_validation",
    "sliced_start",
    "split",
    "split_and_merge",
    "stochastic_universal_sampling",
    "symmetric",
    "with_prior",
]
