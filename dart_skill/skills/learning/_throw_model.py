"""The model of a throwing skill: what its demonstrations have in common, and which of them count for
a target (8.4.2).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from dart_skill.arm import (
    fit_registration,
)
from dart_skill.common.flight import TENNIS_BALL
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import (
    DSGMR,
    AutonomousDSGMR,
    TaskFrame,
    angles_from_quaternions,
    azimuth_of,
    gaussian_weights,
    nearest_weights,
    quaternions_from_angles,
    turn_about_z,
    turn_matrix,
)
from dart_skill.skills.learning._preparation import PreparedThrow
from dart_skill.skills.learning._refinement import Refinement, Unreachable
from dart_skill.skills.learning._representation import Representation
from dart_skill.skills.learning._task_frames import frames_for
from dart_skill.skills.observation import Slowing
from dart_skill.skills.protocol import Skill, ThrowSettings, general_part, part_of

MARGIN = 0.05
"""Time before the start and after the stop of a motion that is learned, too [s]."""
FINE = 1e-3
"""Noise of a recorded hand [m] up to which a demonstration counts in full, however much better the
others were seen.
"""

Model = DSGMR | AutonomousDSGMR


class ThrowModel:
    """What demonstrations of throws have in common, and the mixtures that are fitted to them.

    Parameters
    ----------
    configuration
        How demonstrations become a model and a model becomes a plan.
    throws
        Demonstrations prepared for this configuration.
    skill
        That is learned, which may have parts of its own; None: those for any skill.

    Attributes
    ----------
    surface
        On which throws come down.
    credence
        (n,) from 0 to 1, how much each of them counts (`credence_of`).
    release
        Float [s], mean release on the clock that the demonstrations share.
    registration
        Of cameras and arm, told from the demonstrations.
    seat
        (3,) [m], centre of the held ball in the frame of the hand's tracked body, the median of
        what was seen.
    hand_delay
        Float [s], median time from the command to the release; 0 if no command was seen.
    width
        Float [m], width of the Gaussian that weights the demonstrations; 0 if all count alike.
    """

    def __init__(
        self,
        configuration: ThrowSettings,
        throws: Sequence[PreparedThrow],
        skill: Skill | None = None,
    ):
        def part(kind: str) -> Any:
            if skill is not None:
                return part_of(skill.with_settings(configuration), kind)
            return general_part(kind, getattr(configuration, kind))

        self.configuration = configuration
        self.throws = tuple(throws)
        self.refinement: Refinement = part("refinement")()
        self.representation: type[Representation] = part("representation")
        self.surface = configuration.game.surface
        self._tasks = np.array([throw.task for throw in throws])
        self.credence = credence_of([throw.noise for throw in throws])
        self._start = float(np.median([throw.start for throw in throws])) - MARGIN
        self._stop = float(np.median([throw.stop for throw in throws]))
        self._moving = [throw.between(self._start, self._stop + MARGIN) for throw in throws]
        self.release = float(
            np.average([throw.release_time for throw in throws], weights=self.credence)
        )
        self._start_pose = np.median([throw.start_pose for throw in throws], axis=0)
        self._posture = _median_posture([throw.start_posture for throw in throws])
        self.registration = fit_registration(
            [throw.sightings for throw in throws], configuration.registration
        )
        self.hand_delay = _median_of_seen(
            [throw.hand_delay - self.registration.delay for throw in throws]
        )
        self.seat = np.median([throw.release.grip for throw in throws], axis=0)
        self.width = configuration.width
        self._whole = None if self.is_local else self._fit(self.credence)

    @cached_property
    def model_id(self) -> str:
        """Digest of what the model was made from: equal demonstrations and configuration give an
        equal name.
        """
        digest = hashlib.sha256(repr(self.configuration).encode())
        for throw in self.throws:
            for part in (throw.task, throw.time, throw.attractor):
                digest.update(np.ascontiguousarray(part).tobytes())
        return digest.hexdigest()[:16]

    @cached_property
    def posture_id(self) -> str:
        """Digest of what plans are made from besides: start posture, registration, seat of the
        ball and delay of the hand.
        """
        digest = hashlib.sha256(repr(self.registration).encode())
        for part in (self._posture, self.seat, np.array(self.hand_delay)):
            digest.update(np.ascontiguousarray(part).tobytes())
        return digest.hexdigest()[:16]

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of the demonstrations."""
        return tuple(throw.id for throw in self.throws)

    @property
    def facts(self) -> tuple[str, ...]:
        """What there is to say of the model."""
        opens = f"the hand opens {1e3 * self.hand_delay:.0f} ms after it is told to"
        return (opens, *filter(None, [self.ball_in_words([one.slowing for one in self.throws])]))

    def ball_in_words(self, flights: Sequence[Slowing]) -> str:
        """What flights say against the mass of the ball of config/world.yaml; empty if nothing, and
        of what is no such ball.
        """
        ball = self.configuration.game.projectile
        return Slowing.together(flights).in_words(ball) if ball == TENNIS_BALL else ""

    def mixture(self, target: np.ndarray) -> GaussianMixture:
        """The mixture (7.21) in the world for one task parameter (3,)."""
        target = np.asarray(target, dtype=float)
        return self.model_for(target).product(self._frames_for(target))

    def frame_mixtures(self, target: np.ndarray) -> list[GaussianMixture]:
        """The mixture of each task frame alone, in the world, for one task parameter (3,): the
        factors of `mixture` (7.21).
        """
        target = np.asarray(target, dtype=float)
        model, frames = self.model_for(target), self._frames_for(target)
        return [
            model.product([frame if k == one else None for k, frame in enumerate(frames)])
            for one in range(len(frames))
        ]

    def model_for(self, task: np.ndarray) -> Model:
        """The fitted DS-GMR for a task (3,): the same for all tasks, or one fitted to the
        demonstrations near it (8.4.2).
        """
        return self._whole if self._whole is not None else self._fit(self._weights(task))

    def bic(self) -> float:
        """Bayesian information criterion of the model of all demonstrations: lower is better.

        Raises
        ------
        ValueError
            Where each target has its own.
        """
        if self._whole is None:
            raise ValueError(
                f"'{self.configuration.name}' has a model for each target, and BIC compares"
                " nothing: take cross_validation"
            )
        _, shown = self._encoded(np.arange(len(self.throws)))
        return self._whole.bic(**shown, weights=self.credence)

    def _fit(self, weights: np.ndarray) -> Model:
        """DS-GMR fitted to the demonstrations with weights (n,); those with weight 0 are left out."""
        used = np.flatnonzero(weights)
        if not len(used):
            raise Unreachable(
                f"no demonstration is near enough for '{self.configuration.name}' to learn from:"
                " teach one there"
            )
        model, shown = self._encoded(used)
        return model.fit(**shown, weights=weights[used])

    def _encoded(self, used: np.ndarray) -> tuple[Model, dict[str, Any]]:
        """A model, not fitted yet, and some of the demonstrations as it takes them."""
        c, moving = self.configuration, [self._moving[i] for i in used]
        model = self.representation.of_throws(c)
        frames = [frames_for(self.throws[i].task, self.throws[i].motion[0], c) for i in used]
        if isinstance(model, DSGMR):
            features = [
                model.features(one.time, one.attractor, self._inputs(one.reach)) for one in moving
            ]
            return model, {"attractors": features, "frames": frames}
        return model, {
            "times": [one.time for one in moving],
            "motions": [(one.motion, one.velocity) for one in moving],
            "frames": frames,
            "attractors": [one.attractor for one in moving],
            "inputs": [[one.reach] for one in moving] if c.distance_input else None,
        }

    def _inputs(self, reach: float) -> list[float] | None:
        """Further inputs of the regression beside time."""
        return [reach] if self.configuration.distance_input else None

    def _frames_for(self, task: np.ndarray) -> list[TaskFrame]:
        return frames_for(task, self._start_features(task)[0], self.configuration)

    def _start_features(self, task: np.ndarray) -> tuple[np.ndarray, float]:
        """Where the hand is before it moves: the demonstrations' start turned to the task's
        azimuth.

        x, y, z, alpha, beta (5,) and the roll, which the throw keeps (8.4.1).
        """
        azimuth = azimuth_of(task)
        position = turn_matrix(azimuth) @ self._start_pose[:3]
        turn = azimuth - self.configuration.angle_azimuth(azimuth)
        angles = self._start_pose[3:]
        if turn:
            angles = angles_from_quaternions(
                turn_about_z(quaternions_from_angles(angles[None]), turn)
            )[0]
        return np.concatenate([position, angles[:2]]), float(angles[2])

    @property
    def is_local(self) -> bool:
        """Whether each target has a model of its own."""
        return self.width > 0 or self.configuration.nearest > 0 or bool(self.configuration.widths)

    def _weights(self, task: np.ndarray) -> np.ndarray:
        """Weight of each demonstration for a task (8.4.2 and chapter 9): by the distance of their
        places.
        """
        place = self._place(task[None])[0]
        if self.configuration.nearest:
            return self.credence * nearest_weights(self._places, place, self.configuration.nearest)
        return self.credence * gaussian_weights(self._places, place, self.width)

    def _place(self, tasks: np.ndarray) -> np.ndarray:
        """What of tasks (n, 3) makes throws differ: in turned frames the reach alone (n, 1), else
        the place on the floor (n, 2).
        """
        return (
            self.surface.coordinates(tasks)[:, :1]
            if self.configuration.frames_turn
            else tasks[:, :2]
        )

    @property
    def shown_coordinates(self) -> np.ndarray:
        """Reach [m] and azimuth [rad] of where the demonstrations went (n, 2)."""
        return self.surface.coordinates(self._tasks)

    @property
    def _places(self) -> np.ndarray:
        return self._place(self._tasks)


def credence_of(noise: Sequence[float]) -> np.ndarray:
    """How much demonstrations count (n,) whose hands were recorded with such noise (n,) [m]: the
    inverse of the variance, relative to the median of them (weighted least squares, A. Aitken,
    1936), and at most 1.
    """
    own = np.asarray(noise, dtype=float)
    usual = max(float(np.median(own)), FINE)
    return np.square(usual / np.maximum(own, usual))


def _median_posture(postures: list[np.ndarray]) -> np.ndarray:
    """Median of the postures (7,) of those whose joints were recorded; nan if those of none were."""
    seen = [posture for posture in postures if np.isfinite(posture).all()]
    return np.median(seen or postures, axis=0)


def _median_of_seen(values: list[float]) -> float:
    """Median of the finite values; 0 if there are none."""
    seen = np.array(values)[np.isfinite(values)]
    return float(np.median(seen)) if len(seen) else 0.0
