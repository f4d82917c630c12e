"""From what the sensors saw to a demonstration, and to what became of a throw."""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use
from dart_skill.skills.observation._cutting import (
    ARRIVAL_NS,
    THRESHOLDS,
    ThrowLog,
    judged,
    seen_down,
    watched_until,
)
from dart_skill.skills.observation._free_flight import FreeFlight, find_flight
from dart_skill.skills.observation._noise import column_noise, position_noise
from dart_skill.skills.observation._outcome import Outcome, Release, fit_release, judge_flight
from dart_skill.skills.observation._sensor_log import RESET_NS, SensorLog
from dart_skill.skills.observation._throw_finder import MEMORY_NS, FoundThrow, ThrowFinder, worlds

if TYPE_CHECKING:
    from dart_skill.skills.observation._arm_in_bag import attach_arm
    from dart_skill.skills.observation._at_rest import basket_at_rest, check_ball_in_hand
    from dart_skill.skills.observation._sightings import sightings
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_arm_in_bag": "attach_arm",
            "_at_rest": "basket_at_rest check_ball_in_hand",
            "_sightings": "sightings",
        },
    )

__all__ = [
    "ARRIVAL_NS",
    "FoundThrow",
    "FreeFlight",
    "MEMORY_NS",
    "Outcome",
    "RESET_NS",
    "Release",
    "SensorLog",
    "THRESHOLDS",
    "ThrowFinder",
    "ThrowLog",
    "attach_arm",
    "basket_at_rest",
    "check_ball_in_hand",
    "column_noise",
    "find_flight",
    "fit_release",
    "judge_flight",
    "position_noise",
    "judged",
    "seen_down",
    "sightings",
    "watched_until",
    "worlds",
]
