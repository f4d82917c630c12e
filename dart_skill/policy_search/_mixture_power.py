"""Multi-optima search: PoWER with a mixture of Gaussians that finds its number of components
(thesis 5.3).

Each component is a local guess with a covariance of its own for exploration. Its prior is the
probability that a trial is drawn from it. The trials are shared among the components by their
responsibilities (5.3)-(5.6). A component is split where two explain the rewarded trials much
better than one. Two components are merged where one explains them as well (5.7)-(5.12). Or the
number of components is set by data spectroscopy (5.13).

    search = MixturePoWER(aim, spread, rng=rng)
    for trial in search.trials(3000):
        search.tell(trial, score(trial.parameters))
    search.mixture.means_, search.component_returns
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number
from dart_skill.mixture import GaussianMixture, SplitMerge, adapt, data_spectroscopy
from dart_skill.policy_search._mixture_policy import MixturePolicy, SizedMixture
from dart_skill.policy_search._power import population, with_defaults
from dart_skill.policy_search._search import (
    Search,
    SearchSettings,
    ToldTrial,
    as_spread,
    first_guess,
)
from dart_skill.policy_search._weights import return_weights

CHOICES = {
    "best_of": ("component", "own", "all"),
    "judged_on": ("latest", "best"),
    "judged_by": ("return", "equal"),
    "structure": ("split_and_merge", "spectroscopy", "fixed"),
    "draw": ("prior", "equal"),
    "guess": ("return", "prior"),
}
EXPLORATIONS = ("constant", "proportional", "automatic")
SURER = SplitMerge(split_threshold=0.3, merge_threshold=0.05, refine=2)
"""With "automatic": components on one hill, each far smaller than the hill, do not overlap, so
splits need more and mergers less.
"""


@dataclass(frozen=True)
class Readings:
    """Options for the points that section 5.3 of the thesis and its pseudocode leave open.

    The readings were measured in the dart experiment of 6.3: returns are expected scores, the
    spread of the player falls from 75 to 16 mm in 3000 iterations, the first Gaussian is on the
    bull with 75 mm, Sigma_0 = (7.5 mm)^2, 20 seeds. The columns are the number of components at
    the end, the regret per throw, and the regret of `parameters`.

        as default          3.1  0.51  0.09        best_of "own"          1.0  0.25  0.02
        refine = 0          1.4  0.28  0.02        best_of "all"          1.0  0.21  0.01
        refine = 1          2.7  0.47  0.08        judged_on "latest"     1.9  0.34  0.03
        refine = 5          3.4  0.58  0.09          and refine = 0       1.0  0.21  0.01
        check_every = 1     4.9  0.84  0.12        judged_by "equal"      3.2  0.54  0.10
        check_every = 50    1.4  0.27  0.02        draw "equal"           2.9  0.49  0.08
        n_axes = 2          3.4  0.56  0.09        normalise = False      2.0  0.37  0.05
        "spectroscopy"      4.3  0.66  0.10          on "latest"          1.0  0.24  0.02
        Sigma_0 = 2.25 mm   4.8  0.81  0.39          and "own"            1.8  0.19  0.07
        Sigma_0 = 15 mm     2.6  0.88  0.11        weighting "rank"       1.0  0.21  0.01
        PoWER               1.0  0.21  0.01        PoWER, 2.25 mm         1.0  0.04  0.01

    The defaults give the three components of figure 6.3 and are closest to the text ("with M
    samples for each component"). The three components appear within 100 trials, while the
    exploration is wide, and hardly change later. By then they have shrunk to Sigma_0 and are far
    from each other, so they neither split nor merge. No reading earns more than PoWER with the
    same Sigma_0. The reasons: components on lower hills get their share of the trials, and the
    hills that are found while the board looks smooth are not those that matter at the end.

    Parameters
    ----------
    best_of
        Which M best trials count for a component. "component" (default): those with the largest
        return times responsibility. "own": the best of those that it is most responsible for.
        "all": the best of all trials.
    structure
        What sets the number of components. "split_and_merge" (default) with `rule`; "spectroscopy"
        with a kernel of `bandwidth`; "fixed".
    check_every
        Int, default 10. The number of components is checked after so many returns.
    most
        Int, default 12. Largest number of components.
    judged_on
        Trials on which it is checked, the "latest" S or the "best" of (5.3) (default).
    judged_by
        Weight of these trials, their "return" (default) or "equal".
    draw
        A trial is drawn from a component with its "prior" (default), or from each with "equal"
        probability.
    guess
        `parameters` is the mean of the component with the highest "return" (default) or the
        largest "prior".
    bandwidth
        Float, in units of the spread; default None: `automatic_bandwidth`.
    rule
        SplitMerge, default with refine = 2.
    """

    best_of: str = "component"
    judged_on: str = "best"
    judged_by: str = "return"
    structure: str = "split_and_merge"
    check_every: int = 10
    most: int = 12
    draw: str = "prior"
    guess: str = "return"
    bandwidth: float | None = None
    rule: SplitMerge = field(default_factory=lambda: SplitMerge(refine=2))

    def __post_init__(self) -> None:
        for name, choices in CHOICES.items():
            if getattr(self, name) not in choices:
                raise ValueError(f"{name} must be one of {choices}, got {getattr(self, name)!r}")
        as_count(self.check_every, "check_every")
        as_count(self.most, "most")
        if self.bandwidth is not None:
            as_number(self.bandwidth, "bandwidth")
        if not isinstance(self.rule, SplitMerge):
            raise ValueError(f"rule must be a SplitMerge, got {type(self.rule).__name__}")


class MixturePoWER(Search):
    """Search for several optima among parameters (d,), with a Gaussian mixture that begins as one
    Gaussian (thesis 5.3).

    An update (5.3)-(5.6) comes after every `batch` returns, from the `best` M of the `latest` S
    trials, as soon as there are M.

    Parameters
    ----------
    parameters : (d,)
        Mean of the first Gaussian.
    spread
        One number or (d,). Standard deviations of the first Gaussian.
    rng
        Numpy Generator.
    exploration
        "constant" (default) adds Sigma_0 to (5.4); "proportional" adds as much in total, in
        proportion to the eigenvalues. "automatic": every component chooses its own size, as
        `PoWER` does. It learns from the trials that were drawn from it, each once; its prior and
        the number of components still come from all of the `latest` trials.
    weighting
        "returns" (default), "rank" or "exponential", see `return_weights`. "returns" takes the
        text literally, and needs returns of at least 0. With the others the best trials have so
        much weight that in darts one component takes all.
    batch
        Int, number of returns between updates; default None: 1. With "automatic", number of its
        own trials after which a component takes a step from the better half of them; default then
        2 (4 + 3 log d). Half as many find fewer hills.
    best
        Int, default 15. M.
    latest
        Int, default 150. S; both as in 6.3.
    minimum_exploration
        Float, default 0.1. Root of Sigma_0 relative to `spread`, which "automatic" does without. A
        hill that moves farther than a few times this within S trials is lost.
    limits : (2,)
        Smallest and largest exploration along any axis, relative to `spread`; default None as in
        `PoWER`.
    readings
        Readings, what the thesis leaves open; default None: its defaults, with "automatic" a split
        from a gain of 0.3 and a merger up to a loss of 0.05.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        exploration: str = "constant",
        weighting: str = "returns",
        batch: int | None = None,
        best: int = 15,
        latest: int = 150,
        minimum_exploration: float = 0.1,
        limits: tuple[float, float] | None = None,
        readings: Readings | None = None,
    ):
        start = first_guess(parameters)
        if exploration not in EXPLORATIONS:
            raise ValueError(
                f"exploration must be one of {EXPLORATIONS}, got {exploration!r}; a mixture learns"
                " its covariances"
            )
        if not isinstance(readings, (Readings, type(None))):
            raise ValueError(
                f"readings must be a Readings, got {type(readings).__name__}: Readings(...) with"
                " what you choose"
            )
        automatic = exploration == "automatic"
        if batch is None:
            batch = 2 * population(start.size) if automatic else 1
        noise = "constant" if automatic else exploration
        settings = with_defaults(
            start.size, noise, weighting, batch, best, latest, minimum_exploration, limits, latest
        )
        settings = replace(settings, exploration=exploration)
        super().__init__(settings, rng)
        self.readings = readings or (Readings(rule=SURER) if automatic else Readings())
        self._policy = (SizedMixture if automatic else MixturePolicy)(
            start, as_spread(spread, start.shape), settings
        )
        least = max(
            self.readings.rule.covariance_floor,
            settings.limits[0] ** 2,
            0.0 if automatic else settings.minimum_exploration**2,
        )
        self._rule = replace(self.readings.rule, covariance_floor=least)
        self._checked = 0

    @property
    def mixture(self) -> GaussianMixture:
        """The policy: priors (K,), means (K, d) and covariances (K, d, d)."""
        return self._policy.mixture

    @property
    def n_components(self) -> int:
        return len(self._policy.priors)

    @property
    def component_returns(self) -> np.ndarray:
        """Mean return (K,) of the latest trials, weighted by each component's responsibilities;
        zeros before the first update.
        """
        return self._policy.returns.copy()

    @property
    def parameters(self) -> np.ndarray:
        """Mean (d,) of the component with the highest return; with guess = "prior", of the one
        with the largest prior.
        """
        policy = self._policy
        best = (policy.returns if self.readings.guess == "return" else policy.priors).argmax()
        return policy.start + policy.scale * policy.means[best]

    @property
    def exploration_size(self) -> float:
        """Largest standard deviation of any component, in units of the spread at the start."""
        return float(np.sqrt(self._policy.variances.max()))

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        ends = (
            np.cumsum(self._policy.priors)
            if self.readings.draw == "prior"
            else np.arange(1.0, self.n_components + 1)
        )
        component = int(np.searchsorted(ends, self._rng.random() * ends[-1], side="right"))
        noise = self._rng.standard_normal(self._policy.start.size)
        tried = self._policy.draw(component, noise)
        if isinstance(self._policy, SizedMixture):
            noise = np.append(noise, self._policy.label(component))
        return noise, tried

    def _learn(self) -> bool:
        if not isinstance(self._policy, SizedMixture):
            return super()._learn()
        last = self._told[-1]
        moved = self._policy.learn(int(last.noise[-1]), replace(last, noise=last.noise[:-1]))
        # Priors and structure come from all of the latest trials, after every return as with the
        # other explorations.
        shared = len(self._told) >= self.settings.best and self._update(
            sorted(self._told, key=lambda told: told.number)
        )
        self.n_updates += moved or shared
        return moved or shared

    def _update(self, told: list[ToldTrial]) -> bool:
        returns = np.array([trial.outcome for trial in told])
        weights = return_weights(returns, len(returns), self.settings.weighting)
        points = self._policy.relative(np.array([trial.tried for trial in told]))
        shared = self._best(returns, weights * self._policy.responsibilities(points))
        if not self._policy.update(points, shared):
            return False
        if self.n_told - self._checked >= self.readings.check_every:
            self._checked = self.n_told
            self._adapt(*self._judged(points, weights, shared))
        self._policy.judge(points, returns)
        return True

    def _best(self, returns: np.ndarray, shared: np.ndarray) -> np.ndarray:
        """Returns times responsibilities (K, n), zero but for the M best; of equals the latest."""
        if self.settings.best >= len(returns):
            return shared
        if self.readings.best_of == "component":
            ranked = shared
        else:
            ranked = np.broadcast_to(returns, shared.shape)
            if self.readings.best_of == "own":
                ranked = np.where(
                    shared.argmax(axis=0) == np.arange(len(shared))[:, None], ranked, -np.inf
                )
        best = (
            len(returns)
            - 1
            - np.argsort(-ranked[:, ::-1], axis=1, kind="stable")[:, : self.settings.best]
        )
        kept = np.zeros_like(shared)
        np.put_along_axis(kept, best, np.take_along_axis(shared, best, axis=1), axis=1)
        return np.where(np.isneginf(ranked), 0.0, kept)

    def _judged(
        self, points: np.ndarray, weights: np.ndarray, shared: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, d) and weights (n,) on which the number of components is checked."""
        if self.readings.judged_on == "best":
            weights = shared.sum(axis=0)
        counted = weights > 0
        weights = weights[counted]
        return points[counted], (
            weights if self.readings.judged_by == "return" else np.ones(len(weights))
        )

    def _adapt(self, points: np.ndarray, weights: np.ndarray) -> None:
        policy = self._policy
        if self.readings.structure == "split_and_merge":
            adapted = adapt(policy.components, points, weights, self._rule, self.readings.most)
            if adapted.split is not None or adapted.merged is not None:
                policy.replace(
                    *adapted.components,
                    noisy=False,
                    origins=origins(self.n_components, adapted.split, adapted.merged),
                )
        elif self.readings.structure == "spectroscopy":
            groups = data_spectroscopy(points, weights, bandwidth=self.readings.bandwidth)
            if groups.n_groups != self.n_components and groups.n_groups <= self.readings.most:
                policy.replace(
                    *grouped(points, weights, groups.labels),
                    noisy=True,
                    origins=[None] * groups.n_groups,
                )

    def _policy_state(self) -> dict:
        return {
            **self._policy.state(),
            "readings": asdict(self.readings),
            "checked": self._checked,
        }

    @classmethod
    def _from_policy_state(
        cls, state: dict, settings: SearchSettings, rng: np.random.Generator
    ) -> MixturePoWER:
        readings = {**state["readings"], "rule": SplitMerge(**state["readings"]["rule"])}
        search = cls(
            state["start"],
            state["scale"],
            rng=rng,
            readings=Readings(**readings),
            **vars(settings),
        )
        search._policy.restore(state)
        search._checked = state["checked"]
        return search


def origins(
    n_components: int, split: int | None, merged: tuple[int, int] | None
) -> list[int | None]:
    """Which of the components each one was before a split and a merger, None for a new one.
    Indices as in `Adaptation`.
    """
    before: list[int | None] = list(range(n_components))
    if split is not None:
        before[split] = None
        before.append(None)
    if merged is not None:
        before[merged[0]] = None
        del before[merged[1]]
    return before


def grouped(
    points: np.ndarray, weights: np.ndarray, labels: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Priors (K,), means (K, d) and covariances (K, d, d) of labelled points (n, d) with weights
    (n,).
    """
    shares = weights * (labels == np.unique(labels)[:, None])
    priors = shares.sum(axis=1)
    shares /= priors[:, None]
    means = shares @ points
    deviations = points - means[:, None]
    return (
        priors / priors.sum(),
        means,
        np.swapaxes(deviations * shares[..., None], 1, 2) @ deviations,
    )
