"""The common base of searches that follow hills by niches (`_niche`)."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_vector
from dart_skill.policy_search._baselines import VectorSearch
from dart_skill.policy_search._search import Settings

AnyNicheSearch = TypeVar("AnyNicheSearch", bound="NicheSearch")


class NicheSearch(VectorSearch):
    """A search that learns from every return at once.

    * parameters: (d,) or (n, d), where the search begins.
    * spread: (d,) or (d, d), covariance of the first trials.
    * limits: smallest and largest radius of trials, relative to `spread`.
    * rng: draws the trials.

    OPTIONS and MEMORY name attributes, without their underscore, that are saved as they are.
    OPTIONS are arguments of the constructor, MEMORY are not.
    """

    OPTIONS: tuple[str, ...] = ()
    MEMORY: tuple[str, ...] = ()

    def __init__(
        self, parameters: ArrayLike, spread: ArrayLike, limits: ArrayLike, rng: np.random.Generator
    ):
        settings = Settings(
            "constant", "rank", 1, 1, 2, 0.0, tuple(as_vector(limits, "limits", 2).tolist())
        )
        super().__init__(parameters, spread, settings, rng)

    def _learn(self) -> bool:
        changed = self._update([self._told[-1]])
        self._fresh = 0
        self.n_updates += changed
        return changed

    def _policy_state(self) -> dict:
        return {
            **super()._policy_state(),
            "options": {name: getattr(self, f"_{name}") for name in self.OPTIONS},
            "memory": {name: getattr(self, f"_{name}") for name in self.MEMORY},
        }

    @classmethod
    def _from_policy_state(
        cls: type[AnyNicheSearch], state: dict, settings: Settings, rng: np.random.Generator
    ) -> AnyNicheSearch:
        search = cls(
            state["start"], state["scale"], rng=rng, limits=settings.limits, **state["options"]
        )
        for name in cls.MEMORY:
            setattr(search, f"_{name}", state["memory"][name])
        return search
