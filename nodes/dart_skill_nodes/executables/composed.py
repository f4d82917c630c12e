"""Simulator, motion capture, commander, recorder, teacher and coach in one process and one executor: the same nodes, faster."""

from dart_skill_nodes.executables.coach import CoachNode
from dart_skill_nodes.executables.commander import CommanderNode
from dart_skill_nodes.executables.demonstration_recorder import DemonstrationRecorder
from dart_skill_nodes.executables.mock_optitrack import MockOptitrack
from dart_skill_nodes.executables.teacher import TeacherNode
from dart_skill_nodes.executables.wam_simulator import WamSimulator
from dart_skill_nodes.process.node_base import run


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill composed`."""
    run(lambda: [DemonstrationRecorder(), MockOptitrack(), CommanderNode(), TeacherNode(), CoachNode(), WamSimulator()], args)


if __name__ == "__main__":
    main()
