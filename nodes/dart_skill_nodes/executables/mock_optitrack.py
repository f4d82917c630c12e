"""The mock OptiTrack: 12 cameras look at the simulated world and publish as vrpn_mocap does.

/vrpn_mocap/<body>/pose, PoseStamped, 100 Hz, frame `world`. A body that too few cameras see is not
published, as the real driver does. Stamps are those of the exposure (vrpn_mocap:
use_vrpn_timestamps); messages come a latency later. They are reliable, because the same seed must
give the same throw on a busy machine too; `reliability: best_effort` is what vrpn_mocap does.
"""

from functools import lru_cache

import numpy as np
from dart_skill_msgs.msg import FramesDelivered, SimulationState
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import TransitionCallbackReturn
from rosgraph_msgs.msg import Clock

from dart_skill.arm import Transform
from dart_skill.common.checks import as_place, as_vector
from dart_skill.common.configuration import node_parameters
from dart_skill.recording import HAND
from dart_skill.simulation import (
    ArmGeometry,
    BasketWalls,
    Board,
    LatencyQueue,
    MotionCapture,
    PlantSettings,
)
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.fixed_layout import FixedLayout, LayoutReader
from dart_skill_nodes.comms.for_viewers import LiveTransforms
from dart_skill_nodes.comms.names import CLOCK, pose_topic
from dart_skill_nodes.comms.qos import CLOCK_QOS, FRAMES, POSES
from dart_skill_nodes.comms.refusals import GuardedLifecycleNode
from dart_skill_nodes.comms.seen_in_step import DELIVERED
from dart_skill_nodes.process.node_base import OK, WARN, Diagnostics, autostart, run
from dart_skill_nodes.process.parameters import declare, declare_bodies, declare_row, skill_of

STEP_NS = PlantSettings().step_ns
CAMERAS = "cameras"
"""Their parameters are below this name."""
FIELDS = {"position": "place of camera", "look_at": "a point that is looked at by camera"}
"""What is said of each camera, and what that is."""
Capsules = tuple[np.ndarray, ...]
Bodies = dict[str, tuple[np.ndarray, np.ndarray]]
"""Positions (3,) [m] and quaternions (4,) by role."""


@lru_cache(maxsize=1)
def _board(bull: tuple[float, float, float]) -> Board:
    return Board(bull)


def _check_cameras(parameters) -> SetParametersResult:
    """A place of a camera that is none is refused."""
    try:
        for one in parameters:
            if one.name.startswith(f"{CAMERAS}."):
                as_vector(one.value, one.name, 3)
    except ValueError as error:
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)


class MockOptitrack(GuardedLifecycleNode):
    """Camera system as a managed node; it configures and activates itself unless `autostart` is
    false.
    """

    def __init__(self):
        super().__init__("mock_optitrack")
        self.p = declare(self, "mock_optitrack")
        skill = skill_of(self)
        self._tells_deliveries = skill.watched
        self._name_of = declare_bodies(self, (HAND, *skill.bodies))
        self._bodies = [
            role for role in self._name_of if not skill.in_the_open or role in self.p["bodies"]
        ]
        self._declare_cameras()
        self._capture, self._queue = None, LatencyQueue()
        self._published, self._lost = {}, {}
        self._active, self._frame_ns, self._episode = False, 0, None
        self._newest, self._clock_ns, self._delivered = {}, 0, None
        if self.p["autostart"]:
            autostart(self)

    def _declare_cameras(self) -> None:
        """The places of the cameras as parameters, with dots in their names."""
        self.add_on_set_parameters_callback(_check_cameras)
        known = node_parameters("optitrack.yaml", "mock_optitrack")["cameras"]
        for name in self.p["camera_names"]:
            for field, about in FIELDS.items():
                row = {"about": f"{about} {name} [m]", "changes": "unconfigured"}
                default = known.get(name, {}).get(field, [0.0, 0.0, 1.0])
                declare_row(self, f"{CAMERAS}.{name}.{field}", row, default)

    def _cameras(self) -> dict:
        return {
            name: {
                field: list(self.get_parameter(f"{CAMERAS}.{name}.{field}").value)
                for field in FIELDS
            }
            for name in self.p["camera_names"]
        }

    # life cycle

    def on_configure(self, state) -> TransitionCallbackReturn:
        parameters = {**self.p, "cameras": self._cameras(), "bodies": self._bodies}
        self._capture = MotionCapture(parameters, self.get_parameter("seed").value)
        if (reliability := self.p["reliability"]) not in POSES:
            raise ValueError(f"reliability = '{reliability}': give one of {', '.join(POSES)}")
        names = self._capture.config.bodies
        self._geometry = ArmGeometry()
        self._publishers_of = {
            name: self.create_publisher(
                PoseStamped, pose_topic(self._name_of[name]), POSES[reliability]
            )
            for name in names
        }
        self._published, self._lost = dict.fromkeys(names, 0), dict.fromkeys(names, 0)
        self._newest = dict.fromkeys(names, 0)
        if self._tells_deliveries:
            self._delivered = self.create_publisher(FramesDelivered, DELIVERED, FRAMES)
        like = PoseStamped()
        like.header.frame_id = self._frame_id = self.p["frame_id"]
        self._layout = FixedLayout(like)
        self._transforms = LiveTransforms(self, self._frame_id)
        self._reader = LayoutReader(SimulationState, conversions.EPISODE_AND_STEP)
        self.create_subscription(
            SimulationState, "simulation/state", self._on_state, FRAMES, raw=True
        )
        self.create_subscription(Clock, CLOCK, self._on_clock, CLOCK_QOS, raw=True)
        self._diagnostics = Diagnostics(self, self._describe)
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state) -> TransitionCallbackReturn:
        self._active = True
        return super().on_activate(state)

    def on_deactivate(self, state) -> TransitionCallbackReturn:
        self._active = False
        self._queue.clear()
        return super().on_deactivate(state)

    # frames

    @property
    def _between_frames(self) -> int:
        """Time between two frames [ns]; when the clock is farther than that, a frame has yet to be
        taken in.
        """
        return round(1e9 / self._capture.config.rate)

    def _on_state(self, data: bytes) -> None:
        truth = conversions.ground_truth(*self._reader.read_all(data))
        ns, frame_ns = truth.stamp_ns, self._between_frames
        if not self._active or (truth.step * STEP_NS) % frame_ns or ns == self._frame_ns:
            return  # an unanswered state is published again: it is the same frame
        # the latter: a simulator that was started again
        if truth.episode != self._episode or ns < self._frame_ns:
            self._episode = truth.episode
            self._capture.begin(truth.episode)
            self._queue.clear()
            self._newest = dict.fromkeys(self._newest, 0)
        self._frame_ns = ns
        bodies = {
            name: truth.bodies[name]
            for name in self._capture.config.bodies
            if name in truth.bodies
        }
        capsules = self._beside_a_board(
            truth.bodies, self._geometry.capsules(truth.joint_position, truth.base_turn)
        )
        samples = self._capture.observe(
            ns,
            truth.episode,
            bodies,
            capsules,
            self._walls(truth.bodies),
            truth.step * STEP_NS // frame_ns,
        )
        for name in set(self._lost) - {sample.name for sample in samples}:
            self._lost[name] += 1
        self._queue.push(samples)
        self._publish_due(max(ns, self._clock_ns))

    def _walls(self, bodies: Bodies) -> BasketWalls | None:
        """What of a basket hides other bodies; None in a world without one."""
        if conversions.BASKET not in bodies:
            return None
        radius, depth = (
            self.get_parameter(name).value for name in ("basket_radius", "basket_depth")
        )
        return BasketWalls(as_place(bodies[conversions.BASKET][0], "the basket"), radius, depth)

    @staticmethod
    def _beside_a_board(bodies: Bodies, capsules: Capsules) -> Capsules:
        """What hides bodies: the arm, and a board where there is one."""
        if conversions.BOARD not in bodies:
            return capsules
        bull = as_place(bodies[conversions.BOARD][0], "the board")
        return tuple(
            np.concatenate(parts)
            for parts in zip(capsules, _board(tuple(bull.tolist())).capsules, strict=True)
        )

    def _on_clock(self, data: bytes) -> None:
        self._clock_ns = conversions.leading_stamp_ns(data)
        self._publish_due(self._clock_ns)

    def _publish_due(self, now_ns: int) -> None:
        for sample in self._queue.due(now_ns):
            numbers = np.concatenate([sample.position, sample.quaternion])
            self._publishers_of[sample.name].publish(self._layout.pack(sample.stamp_ns, numbers))
            if self._transforms.is_due(sample.name, sample.stamp_ns):
                seen = Transform(
                    self._frame_id, self._name_of[sample.name], sample.position, sample.quaternion
                )
                self._transforms.publish([seen], sample.stamp_ns)
            self._published[sample.name] += 1
            self._newest[sample.name] = sample.stamp_ns
        if (
            self._delivered is not None
            and self._delivered.get_subscription_count()
            and now_ns - self._frame_ns < self._between_frames
        ):
            newest = [conversions.time_msg(ns) for ns in self._newest.values()]
            self._delivered.publish(
                FramesDelivered(
                    stamp=conversions.time_msg(now_ns), bodies=list(self._newest), newest=newest
                )
            )

    def _describe(self):
        lost = {f"{name}_lost": count for name, count in self._lost.items()}
        level, text = (OK, "tracking") if self._active else (WARN, "not active")
        return level, text, {**self._published, **lost}


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill mock_optitrack`."""
    run(lambda: [MockOptitrack()], args)


if __name__ == "__main__":
    main()
