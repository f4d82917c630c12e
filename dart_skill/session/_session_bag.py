"""The bag of a session, without ROS: states, commands, poses and demonstrations, on the topics of
the graph's recorder, with its bytes.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from dart_skill.arm import ArmState, Command
from dart_skill.common.world import joint_names, pose_topic, the_world
from dart_skill.recording import (
    DEMONSTRATION_TOPIC,
    DEMONSTRATION_TYPE,
    HAND,
    BagWriter,
    Demonstration,
    Event,
    Track,
    definition,
    demonstration_id,
    demonstration_message,
    encoded,
    message,
    qos_yaml,
    type_hash,
    typestore,
)
from dart_skill.simulation import Sample
from dart_skill.skills.observation import attach_arm
from dart_skill.skills.protocol import Skill

JOINT_STATES = "/joint_states"
"""Topic of the arm's joints."""
COMMAND = "/wam/command"
"""Topic of what the arm is told."""
GUIDING = "/wam/teacher_wrench"
"""Topic of the wrench of a person's hand."""
JOINT_STATE = "sensor_msgs/msg/JointState"
"""Type of messages about the joints."""
WAM_COMMAND = "dart_skill_msgs/msg/WamCommand"
"""Type of messages to the arm and of wrenches."""
POSE = "geometry_msgs/msg/PoseStamped"
"""Type of messages about tracked bodies."""
LAYOUT = "in-process"


class SessionBag:
    """What a session tells it is written when a movement is over; a context manager, which closes
    the bag.

    Parameters
    ----------
    path
        Folder, which must not exist.
    seed
        Of the run.
    skill
        Whose bodies the cameras track.
    """

    def __init__(self, path: str | os.PathLike, seed: int, skill: Skill):
        self._types, self._skill = typestore(), skill
        self._writer = BagWriter(path, custom_data={"seed": str(seed), "layout": LAYOUT})
        attach_arm(self._writer)
        self._poses = {role: pose_topic(the_world().body(role)) for role in (HAND, *skill.bodies)}
        for topic, type_name in (
            (JOINT_STATES, JOINT_STATE),
            (COMMAND, WAM_COMMAND),
            (GUIDING, WAM_COMMAND),
        ):
            self._add(topic, type_name, qos_yaml(depth=10_000))
        for topic in self._poses.values():
            self._add(topic, POSE, qos_yaml(depth=500))
        self._add(
            DEMONSTRATION_TOPIC,
            DEMONSTRATION_TYPE,
            qos_yaml(durability="transient_local", depth=100),
        )
        header = {"frame_id": the_world().frame_id}
        self._state = message(self._types, JOINT_STATE, {"name": list(joint_names())})
        self._command = message(self._types, WAM_COMMAND, {"header": header, "sender": 1})
        self._push = message(self._types, WAM_COMMAND, {"header": header, "sender": 2})
        self._pose = message(self._types, POSE, {"header": header})
        self._waiting: list[tuple[int, str, int, bytes]] = []

    def _add(self, topic: str, type_name: str, qos: str) -> None:
        self._writer.add_topic(
            topic,
            type_name,
            definition(self._types, type_name),
            qos,
            type_hash(self._types, type_name),
        )

    def step(self, arm: ArmState, command: Command, push: Command | None) -> None:
        """A state of the arm, and what answered it.

        Parameters
        ----------
        command, push
            Of controller and person.
        """
        self._state.position, self._state.velocity = arm.position, arm.velocity
        self._keep(JOINT_STATES, JOINT_STATE, self._state, arm.stamp_ns)
        self._keep(COMMAND, WAM_COMMAND, _filled(self._command, command), command.stamp_ns)
        if push is not None:
            self._keep(GUIDING, WAM_COMMAND, _filled(self._push, push), push.stamp_ns)

    def see(self, samples: Iterable[Sample]) -> None:
        """Poses as the cameras delivered them.

        Parameters
        ----------
        samples
            One for each body.
        """
        for sample in samples:
            where, turn = self._pose.pose.position, self._pose.pose.orientation
            where.x, where.y, where.z = sample.position.tolist()
            turn.x, turn.y, turn.z, turn.w = sample.quaternion.tolist()
            self._keep(
                self._poses[sample.name], POSE, self._pose, sample.stamp_ns, sample.publish_ns
            )

    def keep_throw(self, shown: Demonstration, now_ns: int) -> None:
        """A throw that succeeded, at the end of its world.

        Parameters
        ----------
        shown
            The throw.
        """
        opened = shown.stamp_ns + round(1e9 * shown.opened)
        self._demonstrate(
            demonstration_message(self._types, replace(shown, id=demonstration_id(opened))), now_ns
        )

    def keep_movement(self, shown: Demonstration, now_ns: int) -> Demonstration:
        """Keep another movement that succeeded, at the end of its world.

        Parameters
        ----------
        shown
            The movement.

        Returns
        -------
        Demonstration
            It as it is read from the bag, to the last bit.
        """
        kept = self._skill.described(_on_its_own_clock(shown))
        self._demonstrate(demonstration_message(self._types, kept), now_ns)
        return kept

    def _demonstrate(self, content: Any, now_ns: int) -> None:
        self._waiting.append(
            (
                now_ns,
                DEMONSTRATION_TOPIC,
                now_ns,
                encoded(self._types, DEMONSTRATION_TYPE, content),
            )
        )

    def end_of_movement(self) -> None:
        """Write what was told since the last one, in the order of time."""
        for log_ns, topic, stamp_ns, data in sorted(self._waiting, key=lambda one: one[0]):
            self._writer.write(topic, log_ns, stamp_ns, data)
        self._waiting.clear()

    def close(self) -> None:
        """Write what is left, and close the bag."""
        self.end_of_movement()
        self._writer.close()

    def __enter__(self) -> SessionBag:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _keep(
        self, topic: str, type_name: str, content: Any, stamp_ns: int, log_ns: int | None = None
    ) -> None:
        content.header.stamp.sec, content.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
        data = bytes(self._types.serialize_cdr(content, type_name))
        self._waiting.append((stamp_ns if log_ns is None else log_ns, topic, stamp_ns, data))


def _filled(content: Any, command: Command) -> Any:
    """A command written into a message that is used again and again."""
    force, torque = content.wrench.force, content.wrench.torque
    force.x, force.y, force.z, torque.x, torque.y, torque.z = command.wrench.tolist()
    content.joint_torque = np.asarray(command.joint_torque, dtype=float)
    content.grip, content.speed = int(command.grip), int(command.speed)
    return content


def _on_its_own_clock(one: Demonstration) -> Demonstration:
    """A demonstration whose times begin with the first pose of the hand, named after that stamp,
    as the recorder cuts it.
    """
    origin_ns = one.stamp_ns + round(1e9 * float(one.hand_time[0]))

    def since(seconds: np.ndarray) -> np.ndarray:
        return (
            one.stamp_ns + np.round(1e9 * np.asarray(seconds)).astype(np.int64) - origin_ns
        ) * 1e-9

    return replace(
        one,
        id=demonstration_id(origin_ns),
        tracks={
            role: Track(since(track.time), track.position, track.quaternion)
            for role, track in one.tracks.items()
        },
        joint_time=since(one.joint_time),
        events=tuple(
            Event(event.name, float(since(np.array(event.time)))) for event in one.events
        ),
        stamp_ns=origin_ns,
    )
