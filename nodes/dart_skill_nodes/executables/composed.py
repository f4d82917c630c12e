"""Simulator, motion capture, commander, recorder, teacher and coach in one process and one
executor: the same nodes, faster.
"""

from rclpy.logging import get_logger
from rclpy.node import Node

from dart_skill_nodes.executables.coach import CoachNode
from dart_skill_nodes.executables.commander import CommanderNode
from dart_skill_nodes.executables.demonstration_recorder import DemonstrationRecorder
from dart_skill_nodes.executables.mock_optitrack import MockOptitrack
from dart_skill_nodes.executables.teacher import TeacherNode
from dart_skill_nodes.executables.wam_simulator import WamSimulator
from dart_skill_nodes.process.node_base import run


def _started() -> list[Node]:
    nodes = [
        DemonstrationRecorder(),
        MockOptitrack(),
        CommanderNode(),
        TeacherNode(),
        CoachNode(),
        WamSimulator(),
    ]
    get_logger("composed").info(f"ready: {', '.join(node.get_name() for node in nodes)}")
    return nodes


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill composed`."""
    run(_started, args)


if __name__ == "__main__":
    main()
