"""Legs that are played dart by dart with random hits: what the solutions are compared with."""

import numpy as np

from dart_skill.darts import BED_IS_DOUBLE, BED_SCORES, bed_at

PLAYERS = ("me", "them")


def after_hit(remaining, turn_start, points):
    """What is left (n,) after darts that hit points (n, 2) [mm], and which turns were bust (n,)."""
    beds = bed_at(points)
    left = remaining - BED_SCORES[beds]
    bust = (left < 0) | (left == 1) | ((left == 0) & ~BED_IS_DOUBLE[beds])
    return np.where(bust, turn_start, left), bust


def impacts(aims, which, spreads, rng):
    """Where darts at aims (n, 2) hit, (n, 2) [mm], that have the spread of an index (n,) each."""
    factors = np.array([np.linalg.cholesky(spread.covariance) for spread in spreads])
    biases = np.array([spread.bias for spread in spreads])
    return (
        aims
        + biases[which]
        + np.einsum("nij,nj->ni", factors[which], rng.standard_normal(aims.shape))
    )


def _play_turn(policy, turn_start, rng):
    """Score (n,) after a turn from scores (n,), and the darts thrown in it (n,)."""
    remaining, used = turn_start.copy(), np.zeros(len(turn_start), dtype=int)
    on = np.arange(len(turn_start))
    for table in policy.choices:
        choice = table[turn_start[on], turn_start[on] - remaining[on]]
        hits = impacts(policy.aims[choice], policy.which[choice], policy.spreads, rng)
        used[on] += 1
        remaining[on], bust = after_hit(remaining[on], turn_start[on], hits)
        on = on[~bust & (remaining[on] > 0)]
    return remaining, used


def simulate_legs(policy, n_legs, rng, max_turns=10_000):
    """Numbers of turns (n_legs,) and of darts (n_legs,) of legs that are played by a policy."""
    turn_start = np.full(n_legs, policy.start)
    turns, darts = np.zeros(n_legs, dtype=int), np.zeros(n_legs, dtype=int)
    playing = np.arange(n_legs)
    for _ in range(max_turns):
        if len(playing) == 0:
            return turns, darts
        remaining, used = _play_turn(policy, turn_start[playing], rng)
        turns[playing] += 1
        darts[playing] += used
        turn_start[playing] = remaining
        playing = playing[remaining > 0]
    raise AssertionError(f"{len(playing)} of {n_legs} legs are not finished")


def _play_turns(side, begun, against, rng):
    """What is left (n,) after a turn from scores (n,) when the other player has `against` (n,)
    left.
    """
    pairs, of = np.unique(np.stack([begun, against]), axis=1, return_inverse=True)
    turns = [side.choices(*pair) for pair in pairs.T]
    remaining, on = begun.copy(), np.arange(len(begun))
    for used in range(3):
        scored = begun[on] - remaining[on]
        chosen = np.array(
            [
                turns[turn][used][points]
                for turn, points in zip(of.ravel()[on], scored, strict=True)
            ],
            dtype=int,
        )
        hits = impacts(side.aims[chosen], side.which[chosen], side.player.leg.spreads, rng)
        remaining[on], bust = after_hit(remaining[on], begun[on], hits)
        on = on[~bust & (remaining[on] > 0)]
    return remaining


def simulate_match_legs(policy, n_legs, rng, begins="me", max_turns=10_000):
    """Which legs (n_legs,) the side `me` wins."""
    left = np.full((2, n_legs), policy.start)
    throws = PLAYERS.index(begins)
    for _ in range(max_turns):
        on = np.flatnonzero((left > 0).all(axis=0))
        if len(on) == 0:
            return left[0] == 0
        left[throws, on] = _play_turns(
            (policy.me, policy.them)[throws], left[throws, on], left[1 - throws, on], rng
        )
        throws = 1 - throws
    raise AssertionError(f"{len(on)} of {n_legs} legs are not finished")
