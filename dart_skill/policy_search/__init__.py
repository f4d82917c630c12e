"""Search for parameters that earn a higher return, one trial at a time.

PoWER (thesis 5.1, 5.2, 7.4), the multi-optima search with a mixture (5.3), two searches for changing landscapes (`Niches`,
`Sharpening`), and baselines for comparison.
"""

from ._exploration import with_constant_noise, with_proportional_noise
from ._primitive import PrimitivePoWER, PrimitiveTrial
from ._search import Search, Trial
from ._weights import return_weights
from .baselines import CMAES, CrossEntropy, MonteCarlo, RandomRestarts
from .mixture_power import MixturePoWER, Readings
from .niches import Niches
from .power import PoWER
from .sharpening import Sharpening

__all__ = [
    "CMAES",
    "CrossEntropy",
    "MixturePoWER",
    "MonteCarlo",
    "Niches",
    "PoWER",
    "PrimitivePoWER",
    "PrimitiveTrial",
    "RandomRestarts",
    "Readings",
    "Search",
    "Sharpening",
    "Trial",
    "return_weights",
    "with_constant_noise",
    "with_proportional_noise",
]
