"""The bodies of a trial that a person prepares beside a real arm, as the cameras see them: what
stands where it shall, what is in the hand, what is in its way, and what has set off.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dart_skill.common.situation import Pose
from dart_skill.recording import HAND
from dart_skill.skills.observation import TURNED, SensorLog, at_rest, check_in_hand
from dart_skill.skills.protocol import Skill

CLEAR = 0.3
"""A body that is farther from the hand is not in its way [m]."""
SET_OFF = 0.02
"""A body that is farther from where it rested has set off [m]."""
FEW = 5
"""Poses whose median tells that: cameras are noisy, and a belt is not waited for."""

Poses = Mapping[str, Pose]
"""Poses of bodies by role."""


class TrialBodies:
    """What is missing for a trial, with the remedy.

    Parameters
    ----------
    skill
        That is practised.
    log
        Of what the cameras see (`Skill.sensor_log`).
    seat_tolerance
        Of a body in the hand from where it was when the skill was shown [m].
    body_tolerance
        Of a body that stands somewhere from where it shall stand [m].
    """

    def __init__(self, skill: Skill, log: SensorLog, seat_tolerance: float, body_tolerance: float):
        self._skill, self._log = skill, log
        self._seat_tolerance, self._body_tolerance = seat_tolerance, body_tolerance

    def standing(self, until_ns: int, wanted: Poses) -> dict[str, Pose]:
        """Where the bodies stood that are not in the hand, up to an instant.

        Parameters
        ----------
        wanted
            Poses of those that shall stand somewhere.

        Raises
        ------
        ValueError
            Says which body is not seen at rest, or stands elsewhere.
        """
        seen = {role: at_rest(self._log, role, until_ns) for role in self._skill.standing}
        for role, pose in seen.items():
            self._skill.check_seen(role, pose)
            if role in wanted and not self._is_near(wanted[role], pose):
                raise ValueError(self._correction(role, pose, wanted[role]))
        return seen

    def stay(self, until_ns: int, places: Poses) -> bool | None:
        """Whether bodies still rest at their places; None where one is not seen at rest: somebody
        who stands before it has not carried it.
        """
        try:
            seen = {role: at_rest(self._log, role, until_ns) for role in places}
        except ValueError:
            return None
        return all(self._is_near(place, seen[role]) for role, place in places.items())

    def check_in_hand(self, until_ns: int, seat: Pose | None) -> None:
        """ValueError, with what is wrong, unless the body that shall be in the hand rested at its
        seat there up to an instant; None: the hand is empty.
        """
        if seat is not None:
            role, tolerance = self._skill.in_hand, self._seat_tolerance
            check_in_hand(self._log, role, until_ns, seat, tolerance)

    def check_clear(self) -> None:
        """ValueError if the body that is at the hand after a movement was last seen there."""
        if not (role := self._skill.in_the_way):
            return
        hand, body = (self._log.bodies[one].rows[-1:] for one in (HAND, role))
        if hand and body and np.linalg.norm(hand[0][:3] - body[0][:3]) < CLEAR:
            raise ValueError(f"the {role} was last seen less than {CLEAR} m from the hand")

    def check_set_off(self, places: Poses) -> None:
        """ValueError unless the body with whose motion a trial begins has left its place."""
        if role := self._skill.started_by:
            now = np.median([row[:3] for row in self._log.bodies[role].rows[-FEW:]], axis=0)
            if np.linalg.norm(now - places[role].position) < SET_OFF:
                raise ValueError(f"the {role} has not moved yet")

    def _is_near(self, place: Pose, seen: Pose) -> bool:
        away, turn = place.apart(seen)
        return away <= self._body_tolerance and not (self._skill.turned and turn > TURNED)

    def _correction(self, role: str, seen: Pose, wanted: Pose) -> str:
        """How a body shall be moved that is seen elsewhere."""
        x, y, z = wanted.position - seen.position
        said = f"the {role} is seen elsewhere: move it by x {x:+.2f}, y {y:+.2f}, z {z:+.2f} m"
        if not self._skill.turned:
            return said
        forward = seen.sees(wanted).rotation[:, 0]
        return (
            f"{said}, and turn it by {np.degrees(np.arctan2(forward[1], forward[0])):+.0f} degrees"
        )
