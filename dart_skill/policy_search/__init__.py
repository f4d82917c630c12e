"""Search for parameters that earn a higher return, one trial at a time.

PoWER (thesis 5.1, 5.2, 7.4), the multi-optima search with a mixture (5.3), and two searches for
changing landscapes (`Niches`, `Sharpening`). The searches with which these are compared are in
`dart_skill.experiments.studies`: `baselines` and `policy_gradients`.
"""

from dart_skill.policy_search._gaussian_process import BlurredNoise, Surrogate
from dart_skill.policy_search._mixture_power import MixturePoWER, Readings
from dart_skill.policy_search._niche import Niche, forecast
from dart_skill.policy_search._niches import Niches
from dart_skill.policy_search._policy import (
    GaussianPolicy,
    PathLength,
    with_constant_noise,
    with_proportional_noise,
)
from dart_skill.policy_search._power import PoWER, population
from dart_skill.policy_search._primitive import PrimitivePoWER, PrimitiveTrial
from dart_skill.policy_search._search import (
    Search,
    SearchSettings,
    SearchTrial,
    ToldTrial,
    VectorSearch,
    generator_state,
    restored_generator,
)
from dart_skill.policy_search._sharpening import Sharpening
from dart_skill.policy_search._weights import among_best, return_weights

__all__ = [
    "BlurredNoise",
    "GaussianPolicy",
    "MixturePoWER",
    "Niche",
    "Niches",
    "PathLength",
    "PoWER",
    "PrimitivePoWER",
    "PrimitiveTrial",
    "Readings",
    "Search",
    "SearchSettings",
    "SearchTrial",
    "Sharpening",
    "Surrogate",
    "ToldTrial",
    "VectorSearch",
    "among_best",
    "forecast",
    "generator_state",
    "population",
    "restored_generator",
    "return_weights",
    "with_constant_noise",
    "with_proportional_noise",
]
