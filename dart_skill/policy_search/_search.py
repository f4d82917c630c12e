"""The common base of all searches: `ask` for trials and `tell` their returns, one at a time and in
any order; saving.

After every `batch` returns the policy is updated from the best M of the latest S trials. A trial
that failed (its return is NaN or -inf) is counted and not learned from.
"""

from __future__ import annotations

import itertools
import json
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_finite, as_number, as_vector, floats
from dart_skill.common.files import new_file
from dart_skill.policy_search._weights import check_weighting

EXPLORATIONS = ("automatic", "constant", "proportional", "fixed")
GENERATORS = ("PCG64", "PCG64DXSM", "MT19937", "Philox", "SFC64")


@dataclass(frozen=True, eq=False)
class SearchTrial:
    """A trial: its number, which counts from 0, and the parameters (d,) to try."""

    number: int
    parameters: np.ndarray


@dataclass(frozen=True, eq=False)
class ToldTrial:
    """A trial with its outcome.

    Parameters
    ----------
    number
        Of the trial.
    noise
        That it was drawn from.
    tried
        The parameters.
    outcome
        Its return or returns.
    """

    number: int
    noise: np.ndarray
    tried: np.ndarray
    outcome: np.ndarray


@dataclass(frozen=True)
class SearchSettings:
    """Checked options of a search, as `PoWER` explains them.

    Parameters
    ----------
    exploration, weighting
        How exploration is set, and how returns become weights.
    batch, best, latest
        Number of returns between updates, M, and S.
    minimum_exploration
        Root of Sigma_0, relative to the spread.
    limits
        Smallest and largest exploration, relative to the spread.
    """

    exploration: str
    weighting: str
    batch: int
    best: int
    latest: int
    minimum_exploration: float
    limits: tuple[float, float]

    def __post_init__(self) -> None:
        if self.exploration not in EXPLORATIONS:
            raise ValueError(
                f"exploration must be one of {EXPLORATIONS}, got {self.exploration!r}"
            )
        check_weighting(self.weighting)
        for name in ("batch", "best", "latest"):
            as_count(getattr(self, name), name)
        if self.latest < max(2, self.best, self.batch):
            raise ValueError(
                f"latest = {self.latest} must be at least 2, best = {self.best} and batch ="
                f" {self.batch}: raise it"
            )
        as_number(self.minimum_exploration, "minimum_exploration", strict=False)
        low, high = (as_number(limit, "limits") for limit in self.limits)
        if not low < 1.0 < high:
            raise ValueError(
                f"limits must lie on both sides of 1, the spread at the start, got {(low, high)}"
            )


AnySearch = TypeVar("AnySearch", bound="Search")


class Search(ABC):
    """Base class with `ask` and `tell`. A subclass draws trials, checks outcomes, and updates its
    policy from them.

    Parameters
    ----------
    settings
        Checked options.

    Attributes
    ----------
    n_asked, n_told, n_failed
        Numbers of trials that were drawn, that have a finite return, and that failed.
    n_updates
        Number of updates of the policy.
    best_return, best_trial
        The highest return so far, -inf at first, and its trial, None at first.
    """

    def __init__(self, settings: SearchSettings, rng: np.random.Generator):
        if not isinstance(rng, np.random.Generator):
            raise ValueError(
                f"rng must be a numpy Generator, got {type(rng).__name__}: use"
                " numpy.random.default_rng(seed)"
            )
        self.settings, self._rng = settings, rng
        self._open: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._told: deque[ToldTrial] = deque(maxlen=settings.latest)
        self._fresh = 0
        self.n_asked = self.n_told = self.n_failed = self.n_updates = 0
        self.best_return = -np.inf
        self.best_trial: SearchTrial | None = None

    @property
    @abstractmethod
    def parameters(self) -> np.ndarray:
        """Best guess (d,) of the policy."""

    @property
    @abstractmethod
    def exploration_size(self) -> float:
        """Largest standard deviation of the next trial, in units of the spread at the start."""

    @abstractmethod
    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        """Noise, and the parameters (d,) that it gives."""

    def _present(self, number: int, tried: np.ndarray) -> SearchTrial:
        return SearchTrial(number, tried)

    def _read(self, outcome: ArrayLike) -> np.ndarray:
        """The checked return, or the returns to go, the first of which is the whole return; NaN
        for a failed trial.
        """
        return read_returns(outcome, (), self.settings.weighting)

    @abstractmethod
    def _update(self, told: list[ToldTrial]) -> bool:
        """Update the policy from these trials; returns whether it changed."""

    def _policy_state(self) -> dict:
        raise TypeError(f"a search of kind {type(self).__name__} cannot be saved")

    @classmethod
    def _from_policy_state(
        cls: type[AnySearch], state: dict, settings: SearchSettings, rng: np.random.Generator
    ) -> AnySearch:
        raise TypeError(f"a search of kind {cls.__name__} cannot be saved")

    def ask(self) -> SearchTrial:
        """Draw a trial. Several trials may be open (asked and not yet told) at a time."""
        number = self.n_asked
        self.n_asked += 1
        noise, tried = self._draw()
        tried.setflags(write=False)
        self._open[number] = noise, tried
        return self._present(number, tried)

    def tell(self, trial: SearchTrial | int, outcome: ArrayLike) -> bool:
        """Give the outcome of a trial, or of the trial with that number.

        The outcome is a number, the return. NaN or -inf: the trial failed or was not run.

        Returns
        -------
        bool
            Whether the policy was updated.

        Raises
        ------
        ValueError
            For a trial that was not asked or was told before.
        """
        number = self._find(trial)
        outcome = self._read(outcome)
        noise, tried = self._open.pop(number)
        if not np.isfinite(outcome).all():
            self.n_failed += 1
            return False
        self.n_told += 1
        self._keep_best(number, tried, outcome)
        self._told.append(ToldTrial(number, noise, tried, outcome))
        self._fresh += 1
        return self._learn()

    def trials(self, n_trials: int | None = None, tolerance: float = 0.0) -> Iterator[SearchTrial]:
        """Iterator over new trials: n_trials of them (None: no limit), until `exploration_size` is
        below `tolerance`.
        """
        tolerance = as_number(tolerance, "tolerance", strict=False)
        numbers = (
            itertools.count() if n_trials is None else range(as_count(n_trials, "n_trials", 0))
        )
        return (
            self.ask()
            for _ in itertools.takewhile(lambda _: self.exploration_size >= tolerance, numbers)
        )

    def __iter__(self) -> Iterator[SearchTrial]:
        return self.trials()

    def maximise(
        self, return_function: Callable, n_trials: int, tolerance: float = 0.0
    ) -> np.ndarray:
        """At most n_trials trials with return_function(parameters (d,))

        Parameters
        ----------
        return_function
            Tries parameters.
        tolerance
            It stops where `exploration_size` is below.

        Returns
        -------
        np.ndarray
            The policy's parameters (d,) at the end.
        """
        for trial in self.trials(n_trials, tolerance):
            self.tell(trial, return_function(self._argument(trial)))
        return self.parameters

    def _argument(self, trial: SearchTrial) -> np.ndarray:
        return trial.parameters

    def _find(self, trial: SearchTrial | int) -> int:
        number = trial.number if isinstance(trial, SearchTrial) else trial
        if (
            isinstance(number, (bool, np.bool_))
            or not isinstance(number, (int, np.integer))
            or not 0 <= number < self.n_asked
        ):
            raise ValueError(f"trial {number!r} was never asked; tell what ask() gave")
        if number not in self._open:
            raise ValueError(f"trial {number} was told before; each counts once")
        if isinstance(trial, SearchTrial) and not np.array_equal(
            trial.parameters, self._open[number][1]
        ):
            raise ValueError(
                f"trial {number} is not as it was asked; it comes from another search or was"
                " changed"
            )
        return int(number)

    def _keep_best(self, number: int, tried: np.ndarray, outcome: np.ndarray) -> None:
        earned = float(outcome.flat[0])
        if earned > self.best_return:
            self.best_return, self.best_trial = earned, self._present(number, tried)

    def _learn(self) -> bool:
        if self._fresh < self.settings.batch or len(self._told) < self.settings.best:
            return False
        self._fresh = 0
        # Sorted by number, so that the order of telling does not change one bit of the result.
        changed = self._update(sorted(self._told, key=lambda told: told.number))
        self.n_updates += changed
        return changed

    def state(self) -> dict:
        """The whole state as numbers, strings, lists and dicts for JSON.

        A search made from it by `from_state` continues with exactly the same trials.
        """
        best = self.best_trial
        state = {
            "kind": type(self).__name__,
            "settings": vars(self.settings),
            "counts": [self.n_asked, self.n_told, self.n_failed, self.n_updates, self._fresh],
            "open": [[number, *drawn] for number, drawn in self._open.items()],
            "told": [list(vars(told).values()) for told in self._told],
            "best": best and [self.best_return, best.number, best.parameters],
            "generator": generator_state(self._rng),
            "policy": self._policy_state(),
        }
        return as_json(state)

    @classmethod
    def from_state(cls: type[AnySearch], state: dict) -> AnySearch:
        """A search as it was when `state()` was called.

        Raises
        ------
        ValueError
            For what is none.
        """
        kind = state.get("kind") if isinstance(state, dict) else type(state).__name__
        if kind != cls.__name__:
            raise ValueError(
                f"state is of {kind!r}, not of {cls.__name__!r}: give what {cls.__name__}.state()"
                " returned"
            )
        try:
            settings = SearchSettings(
                **{**state["settings"], "limits": tuple(state["settings"]["limits"])}
            )
            search = cls._from_policy_state(
                state["policy"], settings, restored_generator(state["generator"])
            )
            search._restore(state)
        except (KeyError, TypeError) as error:
            raise ValueError(
                f"state is damaged ({error}); it was cut or comes from another version"
            ) from error
        return search

    def save(self, path: str | Path) -> None:
        """Write `state()` to a file, as JSON."""
        with new_file(path, replace=True) as file:
            file.write(json.dumps(self.state(), allow_nan=False).encode())

    @classmethod
    def load(cls: type[AnySearch], path: str | Path) -> AnySearch:
        """A search as it was saved."""
        return cls.from_state(json.loads(Path(path).read_text(encoding="utf-8")))

    def _restore(self, state: dict) -> None:
        self.n_asked, self.n_told, self.n_failed, self.n_updates, self._fresh = state["counts"]
        self._open = {
            number: (np.array(noise), _frozen(tried)) for number, noise, tried in state["open"]
        }
        self._told.extend(
            ToldTrial(number, np.array(noise), _frozen(tried), np.array(outcome))
            for number, noise, tried, outcome in state["told"]
        )
        if state["best"] is not None:
            self.best_return, number, tried = state["best"]
            self.best_trial = self._present(number, _frozen(tried))


class VectorSearch(Search):
    """Base class of searches with a first guess and its spread.

    Parameters
    ----------
    parameters : (d,)
        First guess.
    spread
        One number or (d,). Standard deviations of the first trials.
    settings
        Checked options.
    rng
        Numpy Generator.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        settings: SearchSettings,
        rng: np.random.Generator,
    ):
        start = first_guess(parameters)
        super().__init__(settings, rng)
        self._start, self._scale = start, as_spread(spread, start.shape)

    def _relative(self, told: list[ToldTrial]) -> np.ndarray:
        """Parameters tried (n, d), relative to the start of the search, in units of the spread."""
        return (np.array([trial.tried for trial in told]) - self._start) / self._scale


def first_guess(parameters: ArrayLike) -> np.ndarray:
    """The first guess (d,) of a search, checked."""
    start = as_vector(parameters, "parameters")
    if start.size == 0:
        raise ValueError("parameters is empty; a search needs at least one")
    return start


def as_spread(spread: ArrayLike, shape: tuple[int, ...]) -> np.ndarray:
    """Standard deviations as an array of the given shape, from one number or an array of that
    shape.
    """
    spread = as_finite(spread, "spread")
    if spread.shape not in ((), shape):
        raise ValueError(f"spread must be one number or have shape {shape}, got {spread.shape}")
    if (spread <= 0).any():
        raise ValueError(
            f"spread must be above 0, got {spread.min():g}: give the size of a sensible first"
            " exploration"
        )
    return np.broadcast_to(spread, shape).copy()


def read_returns(outcome: ArrayLike, shape: tuple[int, ...], weighting: str) -> np.ndarray:
    """The return, or returns, as an array of the given shape; NaN and -inf are allowed, for a
    failed trial.
    """
    try:
        values = np.array(floats(outcome))
    except (TypeError, ValueError):
        raise ValueError(
            f"return must be a number, got {outcome!r}; tell NaN for a trial that failed"
        ) from None
    if values.shape != shape:
        raise ValueError(
            f"return must have shape {shape}, got {values.shape}; one trial is told at a time"
        )
    if (values == np.inf).any():
        raise ValueError("return is +inf; give a finite return, or NaN when the trial failed")
    if weighting == "returns" and np.isfinite(values).all() and (values < 0).any():
        raise ValueError(
            f"return {values.min():g} is negative; weighting 'returns' needs at least 0, use"
            " 'rank' or 'exponential'"
        )
    return values


def _frozen(values: ArrayLike) -> np.ndarray:
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array


def as_json(value: Any) -> Any:
    """Nested dicts and lists in which arrays and tuples are replaced by lists and numpy numbers by
    Python numbers.
    """
    if isinstance(value, dict):
        return {key: as_json(part) for key, part in value.items()}
    if isinstance(value, (list, tuple, deque)):
        return [as_json(part) for part in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def generator_state(rng: np.random.Generator) -> dict:
    """The state of a generator as numbers, strings, lists and dicts for JSON.

    Parameters
    ----------
    rng
        The generator.
    """
    return as_json(rng.bit_generator.state)


def restored_generator(state: dict) -> np.random.Generator:
    """A generator that goes on as the one did whose `generator_state` this is.

    Parameters
    ----------
    state
        As it was returned.

    Raises
    ------
    ValueError
        For a kind that is not known.
    """
    name = state["bit_generator"]
    if name not in GENERATORS:
        raise ValueError(f"generator {name!r} is not known; use one of {GENERATORS}")
    bits = getattr(np.random, name)()
    bits.state = state
    return np.random.Generator(bits)
