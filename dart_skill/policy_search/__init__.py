"""Search for parameters that earn a higher return, one trial at a time.

PoWER (thesis 5.1, 5.2, 7.4), the multi-optima search with a mixture (5.3), two searches for
changing landscapes (`Niches`, `Sharpening`), the policy gradients of chapter 4 (`Reinforce`,
`EpisodicNaturalActorCritic`), and other baselines.
"""

from dart_skill.policy_search._baselines import CMAES, CrossEntropy, MonteCarlo, RandomRestarts
from dart_skill.policy_search._exploration import (
    PathLength,
    with_constant_noise,
    with_proportional_noise,
)
from dart_skill.policy_search._gradient_search import EpisodicNaturalActorCritic, Reinforce
from dart_skill.policy_search._gradients import (
    natural_gradient,
    optimal_baseline,
    reinforce_gradient,
)
from dart_skill.policy_search._mixture_power import MixturePoWER, Readings
from dart_skill.policy_search._niches import Niches
from dart_skill.policy_search._power import PoWER
from dart_skill.policy_search._primitive import PrimitivePoWER, PrimitiveTrial
from dart_skill.policy_search._search import Search, Trial, generator_state, restored_generator
from dart_skill.policy_search._sharpening import Sharpening
from dart_skill.policy_search._weights import return_weights

__all__ = [
    "CMAES",
    "CrossEntropy",
    "EpisodicNaturalActorCritic",
    "MixturePoWER",
    "MonteCarlo",
    "Niches",
    "PathLength",
    "PoWER",
    "PrimitivePoWER",
    "PrimitiveTrial",
    "RandomRestarts",
    "Readings",
    "Reinforce",
    "Search",
    "Sharpening",
    "Trial",
    "generator_state",
    "natural_gradient",
    "optimal_baseline",
    "reinforce_gradient",
    "restored_generator",
    "return_weights",
    "with_constant_noise",
    "with_proportional_noise",
]
