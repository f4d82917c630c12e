"""Observations of thrown darts (scores, impact points, misses), and the E-step of EM for them
under a spread.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.darts._board import MISS, N_BEDS, as_points, as_target, parse_score_list
from dart_skill.darts._exact import BedMoments, bed_moments
from dart_skill.darts._spread import Spread

MISSES = ("counted", "unrecorded")
RESOLVED = 1e-12
"""Probabilities below this are round-off: a spread under which a throw is so improbable is
excluded.
"""


class Expectation(NamedTuple):
    """Result of the E-step, with x the place that a dart hit and m the mean of the darts.

    Parameters
    ----------
    log_likelihood
        Of the observed scores.
    n_throws
        Expected number of darts.
    first
        (2,) [mm], expected sum of x - m.
    second
        (2, 2) [mm^2], expected sum of (x - m)(x - m)'.
    """

    log_likelihood: float
    n_throws: float
    first: np.ndarray
    second: np.ndarray


@dataclass(frozen=True, eq=False)
class _Group:
    """Throws at one aim (2,): the k different patterns (k, 83) of beds that they can have hit, and
    their counts (k,).
    """

    aim: np.ndarray
    patterns: np.ndarray
    counts: np.ndarray


@dataclass(frozen=True, eq=False)
class ObservedThrows:
    """All observed throws.

    Parameters
    ----------
    groups
        Throws with a score, by aim.
    offsets : (n, 2) [mm]
        From the aim, of throws with a measured impact.
    point_aims : (n, 2) [mm]
        Their aims.
    misses
        "counted", or "unrecorded" if darts that missed the board were not listed.
    bounced_out
        Number of darts that bounced out.
    """

    groups: tuple[_Group, ...]
    offsets: np.ndarray
    point_aims: np.ndarray
    misses: str
    bounced_out: int

    @property
    def n_throws(self) -> int:
        """Number of throws that are used: all but those that bounced out."""
        return len(self.offsets) + int(sum(group.counts.sum() for group in self.groups))

    def expect(self, spread: Spread) -> Expectation:
        """E-step: likelihood and expected moments of all throws about aim + bias; exact, without
        sampling.
        """
        parts = [_expect_beds(group, spread, self.misses) for group in self.groups]
        if len(self.offsets):
            parts += _expect_points(self.offsets, self.point_aims, spread, self.misses)
        return Expectation(
            sum(part.log_likelihood for part in parts),
            sum(part.n_throws for part in parts),
            sum((part.first for part in parts), np.zeros(2)),
            sum((part.second for part in parts), np.zeros((2, 2))),
        )


def throws_from_scores(
    scores: Sequence[str | int], aims: str | ArrayLike, misses: str
) -> ObservedThrows:
    """Throws from scores.

    Parameters
    ----------
    aims
        One target for all (a name or a point), or one point for each, (n, 2) [mm].
    """
    patterns, bounced = parse_score_list(scores)
    aims = _aims_of(aims, len(patterns))
    patterns, known_aims = patterns[~bounced], aims[~bounced]
    if len(patterns) == 0:
        raise ValueError(
            "every dart bounced out, so nothing is known of where they went; list some scores"
        )
    return ObservedThrows(
        _grouped(patterns, known_aims, misses),
        np.zeros((0, 2)),
        np.zeros((0, 2)),
        misses,
        int(bounced.sum()),
    )


def throws_from_points(
    points: ArrayLike, aims: str | ArrayLike, misses: int | str
) -> ObservedThrows:
    """Throws from measured impacts (n, 2) [mm].

    Parameters
    ----------
    misses
        Number of darts that missed the board, or "unrecorded".
    """
    points = as_points(points)
    if points.ndim != 2 or len(points) == 0:
        raise ValueError(
            f"points must be (n, 2) with at least one impact, got shape {points.shape}"
        )
    if misses == "unrecorded":
        aims = _aims_of(aims, len(points))
        return ObservedThrows((), points - aims, aims, misses, 0)
    if isinstance(misses, (bool, str)) or int(misses) != misses or misses < 0:
        raise ValueError(
            "misses must be the number of darts that missed the board, or 'unrecorded', got"
            f" {misses!r}"
        )
    aims = _aims_of(aims, len(points) + int(misses))
    patterns = np.tile(np.arange(N_BEDS) == MISS, (int(misses), 1))
    return ObservedThrows(
        _grouped(patterns, aims[len(points) :], "counted"),
        points - aims[: len(points)],
        aims[: len(points)],
        "counted",
        0,
    )


def _aims_of(aims: str | ArrayLike, n_throws: int) -> np.ndarray:
    if isinstance(aims, str) or np.ndim(aims) == 1:
        return np.tile(as_target(aims), (n_throws, 1))
    aims = as_points(aims, "aims")
    if aims.shape != (n_throws, 2):
        raise ValueError(
            f"aims must be one target or one point per throw ({n_throws}, 2), got shape"
            f" {aims.shape}"
        )
    return aims


def _grouped(patterns: np.ndarray, aims: np.ndarray, misses: str) -> tuple[_Group, ...]:
    if misses not in MISSES:
        raise ValueError(f"misses must be one of {', '.join(MISSES)}, got {misses!r}")
    if misses == "unrecorded" and patterns[:, MISS].any():
        raise ValueError(
            "the list holds a miss although misses are said to be unrecorded; count them or leave"
            " them out"
        )
    places, which = np.unique(aims, axis=0, return_inverse=True)
    groups = []
    for index, aim in enumerate(places):
        rows, counts = np.unique(patterns[which.ravel() == index], axis=0, return_counts=True)
        groups.append(_Group(aim, rows.astype(float), counts))
    return tuple(groups)


def _expect_beds(group: _Group, spread: Spread, misses: str) -> Expectation:
    beds = bed_moments(group.aim + spread.bias, spread.covariance)
    probability = group.patterns @ beds.probability
    if probability.min() < RESOLVED:
        return Expectation(-np.inf, float(group.counts.sum()), np.zeros(2), np.zeros((2, 2)))
    share = group.counts / probability
    first = share @ (group.patterns @ beds.first)
    second = np.tensordot(share, np.tensordot(group.patterns, beds.second, axes=1), axes=1)
    seen = Expectation(
        float(group.counts @ np.log(probability)), float(group.counts.sum()), first, second
    )
    return seen if misses == "counted" else _with_unseen(seen, beds)


def _with_unseen(seen: Expectation, beds: BedMoments) -> Expectation:
    """Adds the misses that were not recorded: for n recorded throws their expected number is n p /
    (1 - p).
    """
    missed = beds.probability[MISS]
    per_bed = seen.n_throws / (1.0 - missed)
    return Expectation(
        seen.log_likelihood - seen.n_throws * float(np.log1p(-missed)),
        seen.n_throws + per_bed * missed,
        seen.first + per_bed * beds.first[MISS],
        seen.second + per_bed * beds.second[MISS],
    )


def _expect_points(
    offsets: np.ndarray, aims: np.ndarray, spread: Spread, misses: str
) -> list[Expectation]:
    deviation = offsets - spread.bias
    solved = np.linalg.solve(spread.covariance, deviation.T).T
    quadratic = np.einsum("nd,nd->", deviation, solved)
    log_likelihood = -0.5 * quadratic - len(offsets) * float(np.log(2.0 * np.pi * spread.sigma**2))
    seen = Expectation(
        float(log_likelihood), float(len(offsets)), deviation.sum(0), deviation.T @ deviation
    )
    if misses == "counted":
        return [seen]
    nothing = Expectation(0.0, 0.0, np.zeros(2), np.zeros((2, 2)))
    parts = [seen]
    for aim, count in zip(*np.unique(aims, axis=0, return_counts=True), strict=True):
        parts.append(
            _with_unseen(
                nothing._replace(n_throws=float(count)),
                bed_moments(aim + spread.bias, spread.covariance),
            )
        )
        parts[-1] = parts[-1]._replace(n_throws=parts[-1].n_throws - float(count))
    return parts
