"""Motion capture: what an OptiTrack system reports of bodies whose true poses are given.

A body is tracked in a frame when enough cameras have it in their field of view and a free line of
sight past the arm and the walls of the basket. What is tracked gets noise, a calibration error
that stays the same for a run, a latency with jitter, and dropouts; a lost body is not reported at
all. The values in config/optitrack.yaml have their sources in docs/sources.md.

The module knows no robot: the arm is a set of capsules, given with every frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.quaternions import from_vectors, product, rotate
from dart_skill.simulation._lines_of_sight import LinesOfSight


@dataclass(frozen=True)
class Camera:
    """A camera at `position` (3,) that looks at `look_at` (3,), its image upright, in the world
    frame [m].

    Parameters
    ----------
    half_angles
        (2,) of the field of view, horizontal and vertical [rad].
    range
        Of sight [m].
    """

    position: np.ndarray
    look_at: np.ndarray
    half_angles: tuple[float, float] = (np.deg2rad(28.0), np.deg2rad(23.0))
    range: float = 12.0

    def __post_init__(self) -> None:
        for name in ("position", "look_at"):
            object.__setattr__(self, name, _vector(f"camera {name}", getattr(self, name), 3))
        axis = self.look_at - self.position
        if np.linalg.norm(axis[:2]) < 1e-6:
            raise ValueError(
                f"camera at {self.position} looks straight up or down: move look_at sideways"
            )
        if len(self.half_angles) != 2 or not all(
            0.0 < angle < np.pi / 2 for angle in self.half_angles
        ):
            raise ValueError(
                f"half_angles = {self.half_angles}: give two angles between 0 and pi/2 rad"
            )
        if not (np.isfinite(self.range) and self.range > 0.0):
            raise ValueError(f"range = {self.range}: give the range of the camera in metres")

    @property
    def axes(self) -> np.ndarray:
        """(3, 3) right, down and viewing direction as rows, unit vectors in the world frame."""
        forward = self.look_at - self.position
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right = right / np.linalg.norm(right)
        return np.stack([right, np.cross(forward, right), forward])


@dataclass(frozen=True)
class MotionCaptureConfig:
    """Cameras and errors of a motion-capture system.

    Parameters
    ----------
    cameras
        Where they stand, and what they see.
    bodies
        Which of hand, ball and basket are tracked.
    rate
        Frames per second [1/s].
    min_cameras
        That must see a body.
    clearance
        What is nearer to a body than this does not hide it [m].
    noise
        Standard deviation of a coordinate [m].
    marker_spread
        Extent of a body's markers [m]; the noise of an orientation is noise / marker_spread [rad].
    calibration_error
        Offset of every body, drawn once for a run [m].
    ball_noise
        Standard deviation of a coordinate of the ball on top of `noise` [m]: it has fewer markers,
        and they turn with it.
    ball_offset
        Of the centre of the ball's markers from its own, drawn once for a run [m].
    hand_turn
        Of the axes of the hand's body from those of the hand, about an axis drawn once for a run
        [rad].
    registration_turn, registration_shift
        Of the cameras' world from that of the arm, about an axis and in a direction drawn once for
        a run [rad], [m].
    stamp_delay
        Poses carry stamps that are late by so much, as those of their receipt are [s].
    latency, latency_jitter
        From the exposure to the message, and the mean of the exponential delay on top of it [s].
    dropout_rate
        Dropouts of a body per second [1/s].
    dropout_frames
        Shortest and longest dropout [frames].
    """

    cameras: tuple[Camera, ...]
    bodies: tuple[str, ...] = ("hand", "ball", "basket")
    rate: float = 100.0  # frames per second
    min_cameras: int = 2  # that must see a body
    clearance: float = 0.1  # what is nearer to a body than this does not hide it
    noise: float = 1e-4  # standard deviation of a coordinate
    marker_spread: float = (
        0.1  # distance of a body's markers: orientation noise is noise / spread [rad]
    )
    calibration_error: float = 2e-4  # length of the offset of each body, drawn once for a run
    ball_noise: float = 0.0
    ball_offset: float = 0.0
    hand_turn: float = 0.0
    registration_turn: float = 0.0
    registration_shift: float = 0.0
    stamp_delay: float = 0.0
    latency: float = 5e-3  # from the exposure to the message
    latency_jitter: float = 4e-4  # mean of an exponential delay on top of it
    dropout_rate: float = 0.05  # dropouts of a body per second
    dropout_frames: tuple[int, int] = (1, 10)  # shortest and longest dropout

    def __post_init__(self) -> None:
        for name in ("cameras", "bodies", "dropout_frames"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        self._check_numbers()
        if not self.cameras or not 1 <= self.min_cameras <= len(self.cameras):
            raise ValueError(
                f"min_cameras = {self.min_cameras} of {len(self.cameras)} cameras: need 1 to all"
                " of them"
            )
        if len(set(self.bodies)) != len(self.bodies) or not self.bodies:
            raise ValueError(f"bodies = {self.bodies}: give at least one name, each once")
        if (
            len(self.dropout_frames) != 2
            or not 1 <= self.dropout_frames[0] <= self.dropout_frames[1]
        ):
            raise ValueError(
                f"dropout_frames = {self.dropout_frames}: give shortest and longest, at least 1"
                " frame"
            )

    def _check_numbers(self) -> None:
        positive = ("rate", "marker_spread")
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, tuple) or item.name == "min_cameras":
                continue
            if not np.isfinite(value) or value < 0.0 or (value == 0.0 and item.name in positive):
                raise ValueError(f"motion capture: {item.name} = {value} is out of range")

    @classmethod
    def from_parameters(cls, parameters: Mapping) -> MotionCaptureConfig:
        """Configuration from the parameters of the node `mock_optitrack` (config/optitrack.yaml).

        `camera_names` lists the cameras and their order; each has `cameras.<name>.position` and
        `.look_at`, nested or with dots in the keys. `half_angles_deg` and `range` hold for all.
        Unknown keys belong to the node: ignored.
        """
        half_angles: Any = tuple(np.deg2rad(parameters.get("half_angles_deg", (28.0, 23.0))))
        distance = float(parameters.get("range", 12.0))
        cameras = [
            _camera(parameters, name, half_angles, distance)
            for name in _lookup(parameters, "camera_names")
        ]
        own = {item.name for item in fields(cls)} - {"cameras"}
        return cls(
            cameras=tuple(cameras),
            **{key: value for key, value in parameters.items() if key in own},
        )


def _camera(
    parameters: Mapping, name: str, half_angles: tuple[float, float], distance: float
) -> Camera:
    """One of the cameras; ValueError names it if it has no place."""
    position, look_at = (
        _lookup(parameters, f"cameras.{name}.{which}") for which in ("position", "look_at")
    )
    try:
        return Camera(position, look_at, half_angles, distance)
    except ValueError as error:
        raise ValueError(f"cameras.{name} of optitrack.yaml: {error}") from error


Pose = tuple[np.ndarray, np.ndarray]
"""Position (3,) and quaternion (4,) x, y, z, w."""


@dataclass(frozen=True)
class BasketWalls:
    """Opaque wall of a basket: upright cylinder that hangs `depth` below its rim's centre (3,)
    [m].

    Parameters
    ----------
    radius
        Of the cylinder [m].
    """

    rim: np.ndarray
    radius: float
    depth: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "rim", _vector("rim of the basket", self.rim, 3))
        if not (self.radius > 0.0 and self.depth > 0.0):
            raise ValueError(
                f"basket: radius {self.radius} and depth {self.depth} must be positive"
            )


class Sample(NamedTuple):
    """A reported pose.

    Parameters
    ----------
    name
        Of the body.
    stamp_ns
        Of the exposure [ns].
    publish_ns
        When the message leaves the driver [ns].
    position
        (3,) [m].
    quaternion
        (4,), x, y, z, w.
    """

    name: str
    stamp_ns: int
    publish_ns: int
    position: np.ndarray  # (3,) [m], world frame
    quaternion: np.ndarray  # (4,) x, y, z, w


MOST_MISSED = 360_000
"""Frames that never came are drawn all the same: those of an hour."""
FLYING = ("ball", "dart")
"""Bodies with markers of their own kind: `ball_noise` and `ball_offset` are theirs."""
NO_CAPSULES = (np.empty((0, 2, 3)), np.empty(0))
"""Ends and radii of no capsules."""


@dataclass(frozen=True)
class Frame:
    """The true world at one exposure: what the arguments of `MotionCapture.observe` of the same
    names say.

    Parameters
    ----------
    bodies, capsules
        As of `MotionCapture.observe`.
    number
        Of the frame in its episode.
    """

    stamp_ns: int
    bodies: Mapping[str, tuple[np.ndarray, np.ndarray]]
    capsules: tuple[np.ndarray, np.ndarray] = NO_CAPSULES
    basket: BasketWalls | None = None
    number: int | None = None


class MotionCapture:
    """The whole system. Same seed, episodes and frames: same samples, whatever was visible before.

    Parameters
    ----------
    config
        MotionCaptureConfig, or the parameters that make one.
    """

    def __init__(self, config: MotionCaptureConfig | Mapping, seed: int):
        if not isinstance(config, MotionCaptureConfig):
            config = MotionCaptureConfig.from_parameters(config)
        self.config = config
        self.seed = int(seed)
        self._view = _lines_of_sight(config)
        rng = np.random.default_rng([self.seed])
        self._offsets = _calibration_offsets(config, rng)
        self._turns = _body_turns(config, rng)
        self._registration = _registration(config, rng)
        self._noise = np.array(
            [
                np.hypot(config.noise, config.ball_noise if name in FLYING else 0.0)
                for name in config.bodies
            ]
        )
        self._episode: int | None = None

    def observe(
        self,
        stamp_ns: int,
        episode: int,
        bodies: Mapping[str, tuple[np.ndarray, np.ndarray]],
        capsules: tuple[np.ndarray, np.ndarray] = NO_CAPSULES,
        basket: BasketWalls | None = None,
        number: int | None = None,
    ) -> list[Sample]:
        """Samples of the frame exposed at `stamp_ns`, in the order of `config.bodies`, without
        lost bodies.

        Parameters
        ----------
        bodies
            Name -> (position (3,), quaternion (4,) x, y, z, w) in the world frame; one that is
            configured but not given is not there.
        capsules
            End points (c, 2, 3) and radii (c,) of the arm [m].
        number
            Of the frame in its episode, so that one that never came changes nothing in those after
            it; None: the one after the last. Randomness starts anew from (seed, episode) when the
            episode changes, and every frame takes the same number of draws.
        """
        return self.observe_frames(episode, [Frame(stamp_ns, bodies, capsules, basket, number)])

    def observe_frames(self, episode: int, frames: Sequence[Frame]) -> list[Sample]:
        """The samples that `observe` gives of one frame after the other, at a tenth of its cost
        per frame.

        Every frame has the same bodies, as many capsules, and a basket if another one has.

        Parameters
        ----------
        episode
            Its number.
        """
        if episode != self._episode:
            self.begin(episode)
        noise, dropped, latency_ns = self._draw([frame.number for frame in frames])
        present = self._present(frames)
        if not present:
            return []
        position, quaternion = _check_poses(
            present, [[frame.bodies[name] for name in present] for frame in frames]
        )
        ends, radii = _check_capsules([frame.capsules for frame in frames])
        counts = self._view.count(position, ends, radii, _walls(frames), self.config.min_cameras)
        rows = np.array([self.config.bodies.index(name) for name in present])
        tracked = (counts == self.config.min_cameras) & ~dropped[:, rows]
        position, quaternion = self._measure(rows, position, quaternion, noise[:, rows])
        stamps, late = (
            [int(frame.stamp_ns) for frame in frames],
            round(1e9 * self.config.stamp_delay),
        )
        return [
            Sample(
                present[i],
                stamps[k] + late,
                stamps[k] + latency_ns[k],
                position[k, i],
                quaternion[k, i],
            )
            for k, i in zip(*(part.tolist() for part in np.nonzero(tracked)), strict=True)
        ]

    def begin(self, episode: int) -> None:
        """Start an episode, or the same one anew: `observe` does it when the episode changes, a
        caller whose time jumped back by itself.
        """
        self._episode = episode
        self._rng = np.random.default_rng([self.seed, int(episode)])
        self._frames_drawn = 0
        # frame at which the dropout of each body is over
        self._lost_until = np.zeros(len(self.config.bodies), dtype=int)

    def _draw(self, numbers: Sequence[int | None]) -> tuple[np.ndarray, np.ndarray, list[int]]:
        """Noise (n_frames, n_bodies, 6), whether a body is lost (n_frames, n_bodies), and
        latencies [ns] of frames; all are drawn, whether they are needed or not, and also those of
        missing frames.
        """
        rows = self._since_the_last(numbers)
        n_frames, n_bodies, rng, config = (
            (rows[-1] + 1 if rows else 0),
            len(self.config.bodies),
            self._rng,
            self.config,
        )
        noise, chance = np.empty((n_frames, n_bodies, 6)), np.empty((n_frames, n_bodies))
        lengths, delay = np.empty((n_frames, n_bodies), dtype=int), np.empty(n_frames)
        for k in range(n_frames):
            rng.standard_normal(out=noise[k])
            rng.random(out=chance[k])
            lengths[k] = rng.integers(
                config.dropout_frames[0], config.dropout_frames[1] + 1, size=n_bodies
            )
            delay[k] = rng.exponential()
        frame = self._frames_drawn + np.arange(n_frames)[:, None]
        until = np.where(chance < config.dropout_rate / config.rate, frame + lengths, 0)
        until = np.maximum.accumulate(np.concatenate([self._lost_until[None], until]))
        self._frames_drawn, self._lost_until = self._frames_drawn + n_frames, until[-1]
        latency, dropped = (
            np.rint(1e9 * (config.latency + config.latency_jitter * delay)).astype(int),
            until[1:] > frame,
        )
        if n_frames > len(rows):  # some never came
            noise, dropped, latency = noise[rows], dropped[rows], latency[rows]
        return noise, dropped, latency.tolist()

    def _since_the_last(self, numbers: Sequence[int | None]) -> list[int]:
        """How many frames after the next one each is; ValueError for one that was there already,
        or that is hours away.
        """
        rows, following = [], 0
        for number in numbers:
            row = following if number is None else number - self._frames_drawn
            if row < following:
                last = self._frames_drawn + following - 1
                raise ValueError(
                    f"frame {number} of the episode comes after frame {last}: give them in order"
                )
            if row > MOST_MISSED:
                raise ValueError(
                    f"frame {number} of the episode is {row} frames after the last one that came:"
                    " reset the world"
                )
            rows.append(row)
            following = row + 1
        return rows

    def _present(self, frames: Sequence[Frame]) -> list[str]:
        """Names of the configured bodies that the frames show."""
        unknown = {name for frame in frames for name in frame.bodies} - set(self.config.bodies)
        if unknown:
            raise ValueError(
                f"unknown body {sorted(unknown)}: configured are {list(self.config.bodies)}"
            )
        if any(frame.bodies.keys() != frames[0].bodies.keys() for frame in frames):
            raise ValueError("frames with different bodies: observe them one by one")
        return [name for name in self.config.bodies if frames and name in frames[0].bodies]

    def _measure(
        self, rows: np.ndarray, position: np.ndarray, quaternion: np.ndarray, noise: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What the cameras make of true poses (f, n, 3), (f, n, 4) of the bodies `rows` (n,):
        calibration error and noise (f, n, 6).
        """
        noise = self._noise[rows][:, None] * noise
        offset = rotate(quaternion, self._offsets[rows])
        tilt = from_vectors(noise[..., 3:] / self.config.marker_spread)
        position = position + offset + noise[..., :3]
        quaternion = product(tilt, quaternion)
        if self.config.hand_turn:
            quaternion = product(quaternion, np.broadcast_to(self._turns[rows], quaternion.shape))
        if self._registration is None:
            return position, quaternion
        shift, turn = self._registration
        turn = np.broadcast_to(turn, quaternion.shape)
        return rotate(turn, position) + shift, product(turn, quaternion)


@dataclass
class LatencyQueue:
    """Samples on their way from the cameras to the network: holds each until its time has come."""

    _waiting: list[Sample] = field(default_factory=list)

    def push(self, samples: list[Sample]) -> None:
        """Take samples in, as `MotionCapture.observe` returns them."""
        self._waiting.extend(samples)

    def due(self, now_ns: int) -> list[Sample]:
        """Hand out, in order of publication, what is published at or before `now_ns`."""
        ready = [sample for sample in self._waiting if sample.publish_ns <= now_ns]
        if ready:  # a clock asks at every step of the arm
            self._waiting = [sample for sample in self._waiting if sample.publish_ns > now_ns]
            ready.sort(key=lambda sample: sample.publish_ns)
        return ready

    def clear(self) -> None:
        """Forget what is on its way, as when time jumps back."""
        self._waiting.clear()


def _lines_of_sight(config: MotionCaptureConfig) -> LinesOfSight:
    position, axes, half_angles, ranges = (
        np.array([getattr(camera, name) for camera in config.cameras])
        for name in ("position", "axes", "half_angles", "range")
    )
    return LinesOfSight(position, axes, half_angles, ranges, config.clearance)


def _calibration_offsets(config: MotionCaptureConfig, rng: np.random.Generator) -> np.ndarray:
    """(n_bodies, 3) in the body frames, of the configured length and random direction."""
    direction = rng.standard_normal((len(config.bodies), 3))
    offsets = (
        config.calibration_error * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    )
    for name in set(FLYING) & set(config.bodies) if config.ball_offset else ():
        offsets[config.bodies.index(name)] += config.ball_offset * _direction(rng)
    return offsets


def _direction(rng: np.random.Generator) -> np.ndarray:
    """Unit vector (3,), any direction alike."""
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _body_turns(config: MotionCaptureConfig, rng: np.random.Generator) -> np.ndarray:
    """(n_bodies, 4) quaternions from the axes of each body to those that are reported."""
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (len(config.bodies), 1))
    if config.hand_turn and "hand" in config.bodies:
        turns[config.bodies.index("hand")] = from_vectors(config.hand_turn * _direction(rng))
    return turns


def _registration(
    config: MotionCaptureConfig, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray] | None:
    """Shift (3,) and turn (4,) from the arm's world to that of the cameras; None if they are one."""
    if not (config.registration_turn or config.registration_shift):
        return None
    return config.registration_shift * _direction(rng), from_vectors(
        config.registration_turn * _direction(rng)
    )


def _check_poses(
    names: Sequence[str], poses: Sequence[Sequence[Pose]]
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (f, n, 3) and unit quaternions (f, n, 4); ValueError names the first body whose
    pose is not one.
    """
    for frame in poses:
        for name, (position, quaternion) in zip(names, frame, strict=True):
            if np.shape(position) != (3,):
                raise ValueError(f"position of {name} must be a finite (3,) array, got {position}")
            if np.shape(quaternion) != (4,):
                raise ValueError(
                    f"quaternion of {name} must be a finite (4,) array, got {quaternion}"
                )
    shape = len(poses), len(names), -1
    position = np.concatenate(
        [position for frame in poses for position, _ in frame], dtype=float
    ).reshape(shape)
    quaternion = np.concatenate(
        [quaternion for frame in poses for _, quaternion in frame], dtype=float
    ).reshape(shape)
    norm = np.sqrt(np.einsum("fni,fni->fn", quaternion, quaternion))
    wrong = ~(np.isfinite(position).all(axis=-1) & (np.abs(norm - 1.0) <= 1e-3))
    if wrong.any():
        k, i = np.argwhere(wrong)[0]
        for kind, value in (("position", position[k, i]), ("quaternion", quaternion[k, i])):
            if not np.isfinite(value).all():
                raise ValueError(
                    f"{kind} of {names[i]} must be a finite ({len(value)},) array, got {value}"
                )
        raise ValueError(f"quaternion of {names[i]} has norm {norm[k, i]:.4f}, not 1")
    return position, quaternion / norm[..., None]


def _check_capsules(
    capsules: Sequence[tuple[np.ndarray, np.ndarray]],
) -> tuple[np.ndarray, np.ndarray]:
    """End points (f, c, 2, 3) and radii (f, c) of the capsules of every frame."""
    for ends, radii in capsules:
        if (
            np.ndim(radii) != 1
            or np.shape(ends) != (len(radii), 2, 3)
            or len(radii) != len(capsules[0][1])
        ):
            raise ValueError(
                f"capsules: need end points (c, 2, 3) and radii (c,), got {np.shape(ends)} and"
                f" {np.shape(radii)}"
            )
    ends, radii = (np.array(part, dtype=float) for part in zip(*capsules, strict=True))
    if not (np.isfinite(ends).all() and (radii > 0.0).all()):
        raise ValueError("capsules: end points must be finite and radii positive")
    return ends, radii


def _walls(frames: Sequence[Frame]) -> np.ndarray | None:
    """Centre of the rim, radius and depth of each frame's basket (f, 5); None if there are none."""
    baskets = [frame.basket for frame in frames if frame.basket is not None]
    if not baskets:
        return None
    if len(baskets) < len(frames):
        raise ValueError("frames with and without a basket: observe them one by one")
    return np.array([[*basket.rim.tolist(), basket.radius, basket.depth] for basket in baskets])


def _vector(name: str, value: ArrayLike, size: int) -> np.ndarray:
    value = np.asarray(value, dtype=float)
    if value.shape != (size,) or not all(map(math.isfinite, value.tolist())):
        raise ValueError(f"{name} must be a finite ({size},) vector, got {value}")
    return value


def _lookup(parameters: Mapping[str, Any], key: str) -> Any:
    """A parameter by its dotted name, from nested or flat dictionaries."""
    if key in parameters:
        return parameters[key]
    value = parameters
    for part in key.split("."):
        if not isinstance(value, Mapping) or part not in value:
            raise ValueError(f"motion capture: parameter '{key}' is missing")
        value = value[part]
    return value
