"""Calls of the library, right and wrong ones, for mypy, which reads this module with the library
(pyproject.toml); nobody runs it.

A wrong call says which error mypy must find in it. mypy does not pass where it finds another one,
or none (`warn_unused_ignores`).
"""

import numpy as np

from dart_skill.common.flight import fit_flight, landing
from dart_skill.darts import Spread, best_aim
from dart_skill.mixture import GaussianMixture
from dart_skill.policy_search import PoWER
from dart_skill.session import Session

# --- right ---

place: np.ndarray = landing(np.zeros(3), np.ones(3), -1.0).position
mixture: GaussianMixture = GaussianMixture(2).fit([[0.0], [1.0]], rng=np.random.default_rng(0))
search: PoWER = PoWER.load("search.json")
score: float = best_aim(Spread.isotropic(10.0)).expected_score

# --- wrong ---

landing("high", np.ones(3), 0.0)  # type: ignore[arg-type]  # a str for an array
fit_flight(np.zeros(3))  # type: ignore[call-arg]  # a missing argument
GaussianMixture(n_parts=2)  # type: ignore[call-arg]  # an argument that there is not
GaussianMixture("two")  # type: ignore[arg-type]
Spread.isotropic([10.0])  # type: ignore[arg-type]
Session(seed=1).throw(np.zeros(3))  # type: ignore[arg-type]  # a target for a plan
print(best_aim(10.0).expected_scores)  # type: ignore[attr-defined]
print(PoWER(np.zeros(2), 1.0, rng=np.random.default_rng(0)).best_trial.number)  # type: ignore[union-attr]  # there may be none
