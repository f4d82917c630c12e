"""What other nodes say of themselves on /diagnostics, and in their parameters: where cameras
stand, which numbers can be changed.
"""

import time
from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from dart_skill.simulation import Camera, MotionCaptureConfig
from dart_skill.view import Knob, NodeStatus
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.process.graph_processes import GraphFailure


class NodeInspector:
    """Questions of one node to others; clients are kept."""

    def __init__(self, node: Node, calls: ServiceCalls):
        self._node, self._calls, self._clients = node, calls, {}

    async def values(self, other: str, names: list[str]) -> dict:
        """Parameters of another node by name; GraphFailure if it does not answer."""
        response = await self._ask(
            GetParameters, f"{other}/get_parameters", GetParameters.Request(names=names)
        )
        return {
            name: parameter_value_to_python(value)
            for name, value in zip(names, response.values, strict=True)
        }

    async def cameras(self, other: str) -> tuple[Camera, ...]:
        """Cameras of a motion-capture node with the parameters of mock_optitrack; ValueError or
        KeyError if they make no camera.
        """
        common = await self.values(other, ["camera_names", "half_angles_deg", "range"])
        names = [
            f"cameras.{name}.{field}"
            for name in common["camera_names"]
            for field in ("position", "look_at")
        ]
        config = MotionCaptureConfig.from_parameters(
            {**common, **await self.values(other, names), "min_cameras": 1}
        )
        return config.cameras

    async def knobs(self, other: str) -> list[Knob]:
        """Numbers of another node that have a range and can be changed while it runs."""
        listed = await self._ask(
            ListParameters, f"{other}/list_parameters", ListParameters.Request()
        )
        names = list(listed.result.names)
        described = await self._ask(
            DescribeParameters,
            f"{other}/describe_parameters",
            DescribeParameters.Request(names=names),
        )
        free = [
            one for one in described.descriptors if not one.read_only and one.floating_point_range
        ]
        values = await self.values(other, [one.name for one in free])
        return [_knob(one, values[one.name]) for one in free]

    async def set(self, other: str, name: str, value: float) -> None:
        """Change a number of another node; GraphFailure with its reason if it refuses."""
        request = SetParameters.Request(
            parameters=[Parameter(name, value=float(value)).to_parameter_msg()]
        )
        result = (await self._ask(SetParameters, f"{other}/set_parameters", request)).results[0]
        if not result.successful:
            raise GraphFailure(f"{other} does not take {name} = {value}: {result.reason}")

    async def _ask(self, kind, service: str, request):
        if service not in self._clients:
            self._clients[service] = self._node.create_client(kind, service)
        return await self._calls.call(self._clients[service], request)


class NodeStatuses:
    """The last status of every node; one that has said nothing for SILENT seconds is silent.

    is_ours: of which names a status is kept: /diagnostics is one topic for the graphs of all
    namespaces.
    """

    SILENT = 5.0

    def __init__(self, is_ours: Callable[[str], bool] = lambda name: True):
        self._is_ours = is_ours
        self._heard: dict[str, tuple[float, NodeStatus]] = {}

    def take(self, message: DiagnosticArray) -> list[str]:
        """Keep what a message says; names that have not been heard before."""
        ours = [status for status in message.status if self._is_ours(status.name)]
        new = [status.name for status in ours if status.name not in self._heard]
        for status in ours:
            self._heard[status.name] = (
                time.monotonic(),
                NodeStatus(status.name, status.level[0], status.message),
            )
        return new

    def now(self) -> list[NodeStatus]:
        """Status of all nodes."""
        ages = {name: time.monotonic() - heard for name, (heard, _) in self._heard.items()}
        return [
            NodeStatus(name, DiagnosticStatus.STALE[0], f"silent for {ages[name]:.0f} s")
            if ages[name] > self.SILENT
            else status
            for name, (_, status) in self._heard.items()
        ]


def _knob(descriptor: ParameterDescriptor, value: float) -> Knob:
    bounds = descriptor.floating_point_range[0]
    return Knob(descriptor.name, descriptor.description, bounds.from_value, bounds.to_value, value)
