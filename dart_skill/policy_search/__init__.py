"""Search for parameters that earn a higher return, one trial at a time: PoWER (thesis 5.1, 5.2, 7.4)."""

from ._exploration import with_constant_noise, with_proportional_noise
from ._primitive import PrimitivePoWER, PrimitiveTrial
from ._search import Search, Trial
from ._weights import return_weights
from .power import PoWER

__all__ = [
    "PoWER",
    "PrimitivePoWER",
    "PrimitiveTrial",
    "Search",
    "Trial",
    "return_weights",
    "with_constant_noise",
    "with_proportional_noise",
]
