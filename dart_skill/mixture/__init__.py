"""Gaussian mixtures: algebra of Gaussians (thesis table 3.1), weighted EM (3.2.1), regression (3.2.2), number of
components, split and merge (5.3), data spectroscopy (5.4), likelihood of weighted data (6.4).
"""

from dart_skill.mixture._gaussian import Gaussian, linear_combination, merge, product, product_of_gaussians
from dart_skill.mixture._mixture import GaussianMixture
from dart_skill.mixture._regression import Regression, regress
from dart_skill.mixture._selection import Selection, select_by_bic, select_by_cross_validation
from dart_skill.mixture._spectroscopy import Spectroscopy, automatic_bandwidth, data_spectroscopy
from dart_skill.mixture._split_merge import Adapted, SplitMerge, split, split_and_merge
from dart_skill.mixture._weighted_likelihood import mean_log_likelihood, resampled_mean_log_likelihood, stochastic_universal_sampling

__all__ = [
    "Adapted",
    "Gaussian",
    "GaussianMixture",
    "Regression",
    "Selection",
    "Spectroscopy",
    "SplitMerge",
    "automatic_bandwidth",
    "data_spectroscopy",
    "linear_combination",
    "mean_log_likelihood",
    "merge",
    "product",
    "product_of_gaussians",
    "regress",
    "resampled_mean_log_likelihood",
    "select_by_bic",
    "select_by_cross_validation",
    "split",
    "split_and_merge",
    "stochastic_universal_sampling",
]
