"""The policy of the multi-optima search, a Gaussian mixture over parameters (d,), and its update
from trials (thesis (5.3)-(5.6)).

As in PoWER's policy, a parameter is measured from the start of the search, in units of the spread
at the start.

In a `SizedMixture` every component chooses its own size of exploration, as chapter 9 of the thesis
wishes. The rule for the size, `PathLength`, needs each trial once, and the noise that it was drawn
from. In (5.3)-(5.6) a trial counts for several components and in many updates. Here these two are
kept apart:

* mean and covariance of a component come from the trials that were drawn from it, each once, by
  PoWER with its automatic exploration. So each component has a path of its own, which is that of a
  random walk if all trials are equally good;
* its prior, and whether it is split or merged, comes from all of the latest trials by
  responsibilities, (5.5)-(5.12).

A search that gives each niche a path and a size of its own: O. M. Shir and T. Baeck, Niche radius
adaptation in the CMA-ES niching algorithm, PPSN IX, 2006. It is joined here with the mixture of
the thesis.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dart_skill.mixture import GaussianMixture, symmetric
from dart_skill.policy_search._policy import NOISE, GaussianPolicy
from dart_skill.policy_search._search import SearchSettings, ToldTrial
from dart_skill.policy_search._weights import return_weights

DEAD_SHARE = 1e-6
"""Share of all weight below which a component is dropped."""
FLATTEST = 1e-10
"""Least variance of a component relative to its largest one, so that its covariance can be
inverted.
"""


def alive(mass: np.ndarray) -> np.ndarray:
    """Which components (K,) are kept, by the weight (K,) that each of them has; none if there is
    no weight at all.
    """
    return mass > DEAD_SHARE * mass.sum()


class MixturePolicy:
    """Components with priors (K,), means (K, d) and covariances (K, d, d), stored as variances (K,
    d) along axes (K, d, d).
    """

    def __init__(self, start: np.ndarray, scale: np.ndarray, settings: SearchSettings):
        d = start.size
        self.start, self.scale, self._settings = start, scale, settings
        self.priors, self.means = np.ones(1), np.zeros((1, d))
        self.variances, self.axes = np.ones((1, d)), np.eye(d)[None]
        self.returns: np.ndarray = np.zeros(1)

    @property
    def covariances(self) -> np.ndarray:
        return symmetric((self.axes * self.variances[:, None]) @ np.swapaxes(self.axes, 1, 2))

    @property
    def components(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Priors, means and covariances, relative to the start of the search."""
        return self.priors, self.means, self.covariances

    @property
    def mixture(self) -> GaussianMixture:
        """The policy in the units of the parameters."""
        means, covariances = (
            self.start + self.scale * self.means,
            self.covariances * np.outer(self.scale, self.scale),
        )
        return GaussianMixture.from_parameters(self.priors, means, covariances)

    def draw(self, component: int, noise: np.ndarray) -> np.ndarray:
        """Parameters (d,) of a trial of one component, from standard normal noise (d,)."""
        coloured = self.axes[component] @ (np.sqrt(self.variances[component]) * noise)
        return self.start + self.scale * (self.means[component] + coloured)

    def relative(self, tried: np.ndarray) -> np.ndarray:
        return (tried - self.start) / self.scale

    def responsibilities(self, points: np.ndarray) -> np.ndarray:
        """(5.6): (K, n) for points (n, d) relative to the start."""
        white = (points - self.means[:, None]) @ (self.axes / np.sqrt(self.variances)[:, None])
        logs = np.log(self.priors) - 0.5 * np.log(self.variances).sum(axis=1)
        logs = logs[:, None] - 0.5 * np.einsum("kni,kni->kn", white, white)
        shares = np.exp(logs - logs.max(axis=0))
        return shares / shares.sum(axis=0)

    def update(self, points: np.ndarray, weights: np.ndarray) -> bool:
        """(5.3)-(5.5) from points (n, d), relative to the start, and weights (K, n)

        The weights are returns times responsibilities, of the M best. A component without weight
        is dropped.

        Returns
        -------
        bool
            Whether there was any weight.
        """
        mass = weights.sum(axis=1)
        kept = alive(mass)
        if not kept.any():
            return False
        weights, mass = weights[kept], mass[kept]
        shares = weights / mass[:, None]
        deviations = points - self.means[kept, None]
        covariances = np.swapaxes(deviations * shares[..., None], 1, 2) @ deviations
        self.priors, self.means = (
            mass / mass.sum(),
            self.means[kept] + (shares[:, None] @ deviations)[:, 0],
        )
        self._set_shapes(covariances, noisy=True)
        return True

    def replace(
        self,
        priors: np.ndarray,
        means: np.ndarray,
        covariances: np.ndarray,
        noisy: bool,
        origins: list[int | None],
    ) -> None:
        """Set other components.

        Parameters
        ----------
        noisy
            With exploration noise added to their covariances. The limits hold in any case.
        origins : (K,)
            Which component each of them was before, None for a new one; here it makes no
            difference.
        """
        self.priors, self.means = priors / priors.sum(), means
        self._set_shapes(covariances, noisy)

    def _set_shapes(self, covariances: np.ndarray, noisy: bool) -> None:
        variances, self.axes = np.linalg.eigh(covariances)
        variances = np.maximum(variances, 0.0)
        if noisy:
            noise = NOISE[self._settings.exploration]
            variances = np.array(
                [noise(one, self._settings.minimum_exploration) for one in variances]
            )
        low, high = self._settings.limits
        variances = np.clip(variances, low**2, high**2)
        self.variances = np.maximum(variances, FLATTEST * variances.max(axis=1, keepdims=True))

    def judge(self, points: np.ndarray, returns: np.ndarray) -> None:
        """Set the mean return of each component from the returns (n,) of points (n, d), weighted
        by its responsibilities.
        """
        shares = self.responsibilities(points)
        total = shares.sum(axis=1)
        self.returns = np.where(
            total > 0, shares @ returns / np.where(total > 0, total, 1.0), returns.min()
        )

    def state(self) -> dict:
        return {
            name: getattr(self, name)
            for name in ("start", "scale", "priors", "means", "variances", "axes", "returns")
        }

    def restore(self, state: dict) -> None:
        for name in ("priors", "means", "variances", "axes", "returns"):
            setattr(self, name, np.array(state[name], dtype=float))


@dataclass(eq=False)
class _Component:
    """A policy of PoWER, the label that its trials carry, and those of them that it has not yet
    learned from.
    """

    label: int
    policy: GaussianPolicy
    waiting: list[ToldTrial] = field(default_factory=list)


class SizedMixture(MixturePolicy):
    """The mixture of `MixturePolicy`, whose components learn from their own trials only."""

    def __init__(self, start: np.ndarray, scale: np.ndarray, settings: SearchSettings):
        super().__init__(start, scale, settings)
        self._n_labels = 0
        self._components = [self._new()]

    def label(self, component: int) -> int:
        """By which a component knows its trials, also after others were split or dropped."""
        return self._components[component].label

    def draw(self, component: int, noise: np.ndarray) -> np.ndarray:
        return self._components[component].policy.draw(noise)

    def learn(self, label: int, told: ToldTrial) -> bool:
        """Learn from a trial of the component with this label; True if that made its batch full
        and it took a step.

        A trial whose component was split, merged or dropped since it was asked says nothing about
        the path of another.
        """
        component = next((one for one in self._components if one.label == label), None)
        if component is None:
            return False
        component.waiting.append(told)
        if len(component.waiting) < self._settings.batch:
            return False
        # Sorted by number, so that the order of telling does not change one bit of the result.
        batch = sorted(component.waiting, key=lambda one: one.number)
        component.waiting = []
        weights = return_weights(
            [one.outcome for one in batch], max(len(batch) // 2, 1), self._settings.weighting
        )
        if not weights.any():
            return False
        noise, tried = (
            np.array([one.noise for one in batch]),
            np.array([one.tried for one in batch]),
        )
        component.policy.update(noise, tried, np.broadcast_to(weights[:, None], tried.shape))
        self._read_components()
        return True

    def update(self, points: np.ndarray, weights: np.ndarray) -> bool:
        """(5.5), and a component without weight is dropped; the weights are those of
        `MixturePolicy.update`.
        """
        mass = weights.sum(axis=1)
        kept = alive(mass)
        if not kept.any():
            return False
        if not kept.all():
            self._components = [
                one for one, keep in zip(self._components, kept, strict=True) if keep
            ]
            self._read_components()
        self.priors = mass[kept] / mass[kept].sum()
        return True

    def replace(
        self,
        priors: np.ndarray,
        means: np.ndarray,
        covariances: np.ndarray,
        noisy: bool,
        origins: list[int | None],
    ) -> None:
        """Set other components. What was not split or merged stays as it is, with its path."""
        old = self._components
        self._components = [self._new() if origin is None else old[origin] for origin in origins]
        for component, origin, mean, covariance in zip(
            self._components, origins, means, covariances, strict=True
        ):
            if origin is None:
                component.policy.begin(mean, covariance)
        self.priors = priors / priors.sum()
        self._read_components()

    def _new(self) -> _Component:
        label = self._n_labels
        self._n_labels += 1
        return _Component(
            label, GaussianPolicy(self.start, self.scale, self._settings, diagonal=False)
        )

    def _read_components(self) -> None:
        policies = [one.policy for one in self._components]
        self.means = np.array([one.mean for one in policies])
        variances = np.array([one.size**2 * one.variances for one in policies])
        self.variances = np.maximum(variances, FLATTEST * variances.max(axis=1, keepdims=True))
        self.axes = np.array([one.axes for one in policies])

    def state(self) -> dict:
        parts = [
            {
                "label": one.label,
                "policy": one.policy.state(),
                "waiting": [list(vars(told).values()) for told in one.waiting],
            }
            for one in self._components
        ]
        return {**super().state(), "parts": parts, "n_labels": self._n_labels}

    def restore(self, state: dict) -> None:
        super().restore(state)
        self._components = []
        for part in state["parts"]:
            component = self._new()
            component.label = int(part["label"])
            component.policy.restore(part["policy"])
            component.waiting = [
                ToldTrial(number, *(np.array(value, dtype=float) for value in values))
                for number, *values in part["waiting"]
            ]
            self._components.append(component)
        self._n_labels = int(state["n_labels"])
