"""Gaussian mixtures: algebra of Gaussians (thesis table 3.1), weighted EM (3.2.1), regression (3.2.2), number of
components.
"""

from ._gaussian import Gaussian, linear_combination, merge, product, product_of_gaussians
from ._mixture import GaussianMixture
from ._regression import Regression, regress
from ._selection import Selection, select_by_bic, select_by_cross_validation

__all__ = [
    "Gaussian",
    "GaussianMixture",
    "Regression",
    "Selection",
    "linear_combination",
    "merge",
    "product",
    "product_of_gaussians",
    "regress",
    "select_by_bic",
    "select_by_cross_validation",
]
