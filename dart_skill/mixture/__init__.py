"""Gaussian mixtures: algebra of Gaussians (thesis table 3.1), weighted EM (3.2.1) and regression (3.2.2)."""

from ._gaussian import Gaussian, linear_combination, product, product_of_gaussians
from ._mixture import GaussianMixture
from ._regression import regress

__all__ = ["Gaussian", "GaussianMixture", "linear_combination", "product", "product_of_gaussians", "regress"]
