"""Simulator, motion capture, commander, recorder, teacher and coach in one process and one executor: the same nodes, faster."""

from dart_skill_nodes.coach import CoachNode
from dart_skill_nodes.commander import CommanderNode
from dart_skill_nodes.demonstration_recorder import DemonstrationRecorder
from dart_skill_nodes.mock_optitrack import MockOptitrack
from dart_skill_nodes.support import run
from dart_skill_nodes.teacher import TeacherNode
from dart_skill_nodes.wam_simulator import WamSimulator


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill composed`."""
    run(lambda: [DemonstrationRecorder(), MockOptitrack(), CommanderNode(), TeacherNode(), CoachNode(), WamSimulator()], args)


if __name__ == "__main__":
    main()
