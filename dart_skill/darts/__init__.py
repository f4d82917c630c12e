"""Darts: the board, the thrower's spread, where to aim (thesis chapter 6).

All lengths are in millimetres. The origin is the centre of the bull; x points to the right and y
up, as the thrower sees the board. A dart lands at aim + bias + N(0, covariance). A bed is an area
of the board with one score, such as treble 20.
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use

if TYPE_CHECKING:
    from dart_skill.darts._agent import ModelBasedAgent
    from dart_skill.darts._board import (
        BED_IS_DOUBLE,
        BED_NAMES,
        BED_SCORES,
        HIGHEST_CHECKOUT,
        POSSIBLE_SCORES,
        RADII,
        SECTOR_ANGLE,
        SECTORS,
        as_target,
        bed_at,
        bed_centres,
        direction,
        name_at,
        place_of,
        score,
    )
    from dart_skill.darts._estimation import (
        LikelihoodRatio,
        SpreadEstimate,
        estimate_from_points,
        estimate_from_scores,
    )
    from dart_skill.darts._exact import bed_probabilities, expected_score, score_derivatives
    from dart_skill.darts._heat_map import HeatMap, heat_map
    from dart_skill.darts._leg import (
        CheckoutTable,
        LegDart,
        LegInPlay,
        LegPolicy,
        checkout_table,
        solve_leg,
    )
    from dart_skill.darts._match import (
        AimsApart,
        MatchPolicy,
        MatchSide,
        aims_apart,
        match_chance,
        solve_match,
    )
    from dart_skill.darts._match_players import MatchPlayer, match_player
    from dart_skill.darts._optimum import (
        Aim,
        Jump,
        OptimumPath,
        best_aim,
        local_optima,
        optimum_path,
    )
    from dart_skill.darts._professionals import PROFESSIONALS, professional
    from dart_skill.darts._spread import Spread, SpreadByTarget
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_agent": "ModelBasedAgent",
            "_board": (
                "BED_IS_DOUBLE BED_NAMES BED_SCORES HIGHEST_CHECKOUT POSSIBLE_SCORES RADII"
                " SECTOR_ANGLE SECTORS as_target bed_at bed_centres direction name_at place_of"
                " score"
            ),
            "_estimation": (
                "LikelihoodRatio SpreadEstimate estimate_from_points estimate_from_scores"
            ),
            "_exact": "bed_probabilities expected_score score_derivatives",
            "_heat_map": "HeatMap heat_map",
            "_leg": ("CheckoutTable LegPolicy checkout_table solve_leg LegDart LegInPlay"),
            "_match": ("AimsApart MatchPolicy MatchSide aims_apart match_chance solve_match"),
            "_match_players": "MatchPlayer match_player",
            "_optimum": "Aim best_aim local_optima Jump OptimumPath optimum_path",
            "_professionals": "PROFESSIONALS professional",
            "_spread": "Spread SpreadByTarget",
        },
    )

__all__ = [
    "Aim",
    "AimsApart",
    "BED_IS_DOUBLE",
    "BED_NAMES",
    "BED_SCORES",
    "HIGHEST_CHECKOUT",
    "CheckoutTable",
    "HeatMap",
    "Jump",
    "LegDart",
    "LegInPlay",
    "LegPolicy",
    "LikelihoodRatio",
    "MatchPlayer",
    "MatchPolicy",
    "MatchSide",
    "ModelBasedAgent",
    "OptimumPath",
    "POSSIBLE_SCORES",
    "PROFESSIONALS",
    "RADII",
    "SECTOR_ANGLE",
    "SECTORS",
    "Spread",
    "SpreadByTarget",
    "SpreadEstimate",
    "aims_apart",
    "as_target",
    "bed_at",
    "bed_centres",
    "bed_probabilities",
    "best_aim",
    "checkout_table",
    "direction",
    "estimate_from_points",
    "estimate_from_scores",
    "expected_score",
    "heat_map",
    "local_optima",
    "match_chance",
    "match_player",
    "name_at",
    "optimum_path",
    "place_of",
    "professional",
    "score",
    "score_derivatives",
    "solve_leg",
    "solve_match",
]
