"""What the policy learns, in NumPy: models of dart_skill over the elements of an action, in task
frames. It needs neither lerobot nor torch.

The elements of an action are of three kinds, by their names:

* a pose, `hand.x`, `hand.y`, `hand.z`, and `hand.qx` to `hand.qw` where it turns: learned in task
  frames at the start and at the bodies of `observation.environment_state`; where it turns, on the
  manifold of poses (`dart_skill.movement.pose`);
* coordinates, which the state has under the same name, such as joints: in the axes of the world
  and relative to the start;
* signals, all others, such as a hand that opens: a Gaussian at each step of time, for they jump.

Each demonstration is stretched to the mean duration.
"""

from __future__ import annotations

import io
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.constants import UNTURNED
from dart_skill.common.situation import Pose
from dart_skill.movement import DSGMR, PerStepGaussians, TaskFrame, azimuth_of, turn_about_z
from dart_skill.movement.pose import PerStepPoses, PoseDSGMR, PoseFrame

MODELS = ("dsgmr", "per_step")
PLACE, TURN = ("x", "y", "z"), ("qx", "qy", "qz", "qw")
CLASSES = {
    ("dsgmr", "pose"): PoseDSGMR,
    ("per_step", "pose"): PerStepPoses,
    ("dsgmr", "place"): DSGMR,
    ("dsgmr", "coordinates"): DSGMR,
}
"""Models by setting and kind; for others `PerStepGaussians`."""


@dataclass(frozen=True)
class LearnerSettings:
    """As of `DSGMRConfig`."""

    model: str = "dsgmr"
    n_components: int = 20
    stiffness: float = 400.0
    n_steps: int = 200
    covariance_prior: float = 2.0
    frames: Sequence[str] = ()
    held: str = ""
    fps: float = 30.0
    state_names: Sequence[str] = ()
    environment_names: Sequence[str] = ()
    action_names: Sequence[str] = ()


@dataclass(frozen=True)
class Episode:
    """What was observed and done: state (n, s), environment (n, e), action (n, a)."""

    state: np.ndarray
    environment: np.ndarray
    action: np.ndarray


def names_of(features: Mapping[str, Mapping[str, Any]], key: str) -> list[str]:
    """Names of the elements of a vector, without the unit metre; where it has none, their numbers.

    Parameters
    ----------
    features
        Of a dataset, by key.
    """
    if key not in features:
        return []
    told, size = features[key].get("names"), int(np.prod(features[key]["shape"]))
    while isinstance(told, Mapping):  # {"motors": [...]}
        told = next(iter(told.values()))
    if not isinstance(told, Sequence) or isinstance(told, str) or len(told) != size:
        return [str(number) for number in range(size)]
    return [str(name).removesuffix(" [m]") for name in told]


def bodies_in(names: Sequence[str]) -> dict[str, list[int]]:
    """Bodies of a vector with the numbers of their elements: three, or seven where they turn."""
    at = {name: number for number, name in enumerate(names)}
    found = {}
    for name in names:
        body, dot, axis = name.rpartition(".")
        if dot and axis == "x" and all(f"{body}.{one}" in at for one in PLACE):
            turns = TURN if all(f"{body}.{one}" in at for one in TURN) else ()
            found[body] = [at[f"{body}.{one}"] for one in (*PLACE, *turns)]
    return found


def poses_in(names: Sequence[str], row: np.ndarray) -> dict[str, Pose]:
    """Poses of the bodies of a vector."""
    return {
        body: Pose(row[numbers[:3]], row[numbers[3:]]) if numbers[3:] else Pose(row[numbers])
        for body, numbers in bodies_in(names).items()
    }


def frames_of(
    names: Sequence[str], start: Pose, bodies: Mapping[str, Pose], held: str
) -> list[Pose]:
    """Task frames of a pose in a situation, by their names.

    Parameters
    ----------
    names
        "start", the pose at the start; "world"; a body, with its axes; "azimuth:BODY", at the
        origin, turned about z towards a body; "target:BODY", at that body, turned so.
    start
        Pose at the start.
    held
        Body whose place in the hand counts, or empty.

    Raises
    ------
    ValueError
        Names a body that is not seen.
    """
    made = []
    for name in names or ("start", *bodies):
        kind, _, body = name.rpartition(":")
        if body in ("start", "world") and not kind:
            made.append(start if body == "start" else Pose(np.zeros(3)))
            continue
        if body not in bodies or kind not in ("", "azimuth", "target"):
            there = ", ".join(("start", "world", *bodies))
            raise ValueError(f"there is no frame '{name}': there are {there}")
        pose = bodies[body]
        if kind:
            turned = turn_about_z([UNTURNED], azimuth_of(pose.position))[0]
            pose = Pose(pose.position if kind == "target" else np.zeros(3), turned)
        elif held and body != held:
            pose = pose.place(bodies[held].sees(start))
        made.append(pose)
    return made


@dataclass(frozen=True)
class Part:
    """Elements of an action that one model learns: its kind, and their numbers in the action."""

    kind: str
    numbers: list[int]


@dataclass
class TaskModel:
    """Learns actions from episodes, and plans them from what is observed at the start.

    Attributes after `fit`: models, by kind of elements, and duration [s].
    """

    settings: LearnerSettings
    models: dict[str, Any] = field(default_factory=dict)
    duration: float = 0.0

    @property
    def parts(self) -> list[Part]:
        """The elements of the action by kind."""
        s, left = self.settings, list(range(len(self.settings.action_names)))
        made = []
        known = bodies_in(s.state_names)
        for body, numbers in bodies_in(s.action_names).items():
            if body in known and len(known[body]) >= len(numbers) and not made:
                made.append(Part("pose" if len(numbers) == 7 else "place", numbers))
                left = [number for number in left if number not in numbers]
        coordinates = [number for number in left if s.action_names[number] in s.state_names]
        signals = [number for number in left if number not in coordinates]
        made += [Part("coordinates", coordinates)] if coordinates else []
        return made + ([Part("signals", signals)] if signals else [])

    def fit(self, episodes: Sequence[Episode]) -> TaskModel:
        """Learn from episodes, and return self."""
        fps = self.settings.fps
        self.duration = float(np.mean([len(one.action) - 1 for one in episodes])) / fps
        for part in self.parts:
            model, frames, shown = self._new(part), [], []
            for one in episodes:
                rows = one.action[:, part.numbers]
                time = np.linspace(0.0, self.duration, len(rows))
                encodes = isinstance(model, (DSGMR, PoseDSGMR))
                shown.append(
                    _encoded(model, time, rows) if encodes else np.column_stack([time, rows])
                )
                frames.append(self._frames(part, one.state[0], one.environment[0]))
            self.models[part.kind] = model.fit(shown, frames)
        return self

    def _new(self, part: Part) -> Any:
        s = self.settings
        kind = CLASSES.get((s.model, part.kind), PerStepGaussians)
        if kind is PoseDSGMR:
            return PoseDSGMR(s.n_components, s.stiffness)
        if kind is DSGMR:
            prior = s.covariance_prior
            return DSGMR(s.n_components, s.stiffness, partition="time", covariance_prior=prior)
        return kind(s.n_steps, covariance_prior=s.covariance_prior)

    def _frames(self, part: Part, state: np.ndarray, environment: np.ndarray) -> list[Any]:
        """Task frames of a part in a situation."""
        s, n = self.settings, len(part.numbers)
        if part.kind in ("pose", "place"):
            bodies = poses_in(s.environment_names, environment)
            start = self._start_pose(part, state)
            poses = frames_of(s.frames, start, bodies, s.held)
            if part.kind == "pose":
                return [PoseFrame(one.position, one.quaternion) for one in poses]
            return [_with_time(one.rotation, one.position) for one in poses]
        world = _with_time(np.eye(n), np.zeros(n))
        if part.kind == "signals":
            return [world]
        return [world, _with_time(np.eye(n), state[self._in_state(part)])]

    def _in_state(self, part: Part) -> list[int]:
        s = self.settings
        return [s.state_names.index(s.action_names[number]) for number in part.numbers]

    def _start_pose(self, part: Part, state: np.ndarray) -> Pose:
        body = self.settings.action_names[part.numbers[0]].rpartition(".")[0]
        return poses_in(self.settings.state_names, state)[body]

    def plan(self, state: np.ndarray, environment: np.ndarray) -> np.ndarray:
        """Actions (n, a), one for each frame, from the state (s,) and environment (e,) at the
        start.
        """
        s = self.settings
        time = np.arange(round(self.duration * s.fps) + 1) / s.fps
        actions = np.empty((len(time), len(s.action_names)))
        for part in self.parts:
            model = self.models[part.kind]
            frames = self._frames(part, state, environment)
            if part.kind == "pose" and isinstance(model, PoseDSGMR):
                start = self._start_pose(part, state)
                at = np.concatenate([start.position, start.quaternion])
                rows = model.reproduce(frames, time, at, step=1.0 / s.fps).pose
            elif isinstance(model, DSGMR):
                at = state[self._in_state(part)]
                rows = model.reproduce(
                    frames, time, at, np.zeros(len(at)), step=1.0 / s.fps, covariance=False
                ).position
            else:
                rows = model.retrieve(frames, time)[0]
            actions[:, part.numbers] = rows
        return actions

    def to_bytes(self) -> bytes:
        """What was fitted, to the last bit."""
        file = io.BytesIO()
        with tempfile.TemporaryDirectory() as folder:
            saved = {"duration": np.array(self.duration)}
            for kind, model in self.models.items():
                model.save(Path(folder) / kind)
                content = (Path(folder) / kind).read_bytes()
                saved[kind] = np.frombuffer(content, dtype=np.uint8)
        np.savez(file, **saved)
        return file.getvalue()

    @classmethod
    def from_bytes(cls, settings: LearnerSettings, content: bytes) -> TaskModel:
        """What `to_bytes` gave."""
        made = cls(settings)
        with (
            np.load(io.BytesIO(content), allow_pickle=False) as saved,
            tempfile.TemporaryDirectory() as folder,
        ):
            made.duration = float(saved["duration"])
            for part in made.parts:
                path = Path(folder) / part.kind
                path.write_bytes(saved[part.kind].tobytes())
                made.models[part.kind] = type(made._new(part)).load(path)
        return made


def _encoded(model: DSGMR | PoseDSGMR, time: np.ndarray, rows: np.ndarray) -> np.ndarray:
    if isinstance(model, DSGMR):
        return model.encode(time, rows, faults="keep")
    return model.encode(time, rows)


def _with_time(turn: np.ndarray, origin: np.ndarray) -> TaskFrame:
    """Frame over [t, y] that leaves time alone."""
    n = len(origin)
    A = np.eye(1 + n)
    A[1:, 1:] = turn
    return TaskFrame(A, np.concatenate([[0.0], origin]))
