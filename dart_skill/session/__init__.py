"""Teaching, learning and throwing in one process without ROS, learning from a bag, and the results of
a run.
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use
from dart_skill.session._summary import (
    RunSummary,
    TrialResult,
    error_quantile,
    throws_in_a_line,
    write_summary,
)

if TYPE_CHECKING:
    from dart_skill.session._auto_mapping import auto_mapping
    from dart_skill.session._bench_and_belt import (
        BeltSession,
        BenchSession,
        ReachingPerson,
        SkillTrial,
    )
    from dart_skill.session._darts import (
        BLOCK,
        Dart,
        DartsRun,
        Hit,
        LegSummary,
        own_dart,
        play_leg,
    )
    from dart_skill.session._demo import Job, demo
    from dart_skill.session._disagreement import Cause, Disagreement, disagreement
    from dart_skill.session._finding import find_throws
    from dart_skill.session._from_bag import LearnReport, NothingLearned, learn_from_bag
    from dart_skill.session._from_lerobot import (
        learn_throws_from_dataset,
        open_dataset,
        skill_of_dataset,
    )
    from dart_skill.session._in_process import Session, Trial
    from dart_skill.session._recorded_lessons import learn_skill
    from dart_skill.session._session_bag import LAYOUT, SessionBag
    from dart_skill.session._to_lerobot import FPS, ExportedDataset, PictureMaker, write_lerobot
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_auto_mapping": "auto_mapping",
            "_bench_and_belt": "BeltSession BenchSession ReachingPerson SkillTrial",
            "_darts": "BLOCK Dart DartsRun Hit LegSummary own_dart play_leg",
            "_demo": "Job demo",
            "_disagreement": "Cause Disagreement disagreement",
            "_finding": "find_throws",
            "_from_bag": "LearnReport NothingLearned learn_from_bag",
            "_from_lerobot": ("learn_throws_from_dataset open_dataset skill_of_dataset"),
            "_in_process": "Session Trial",
            "_session_bag": "LAYOUT SessionBag",
            "_recorded_lessons": "learn_skill",
            "_to_lerobot": "FPS ExportedDataset PictureMaker write_lerobot",
        },
    )

__all__ = [
    "BLOCK",
    "BeltSession",
    "BenchSession",
    "Cause",
    "Dart",
    "DartsRun",
    "Disagreement",
    "ExportedDataset",
    "FPS",
    "Hit",
    "Job",
    "LAYOUT",
    "LearnReport",
    "LegSummary",
    "NothingLearned",
    "PictureMaker",
    "ReachingPerson",
    "RunSummary",
    "Session",
    "SessionBag",
    "SkillTrial",
    "Trial",
    "TrialResult",
    "auto_mapping",
    "demo",
    "disagreement",
    "error_quantile",
    "find_throws",
    "learn_from_bag",
    "learn_skill",
    "learn_throws_from_dataset",
    "open_dataset",
    "own_dart",
    "play_leg",
    "skill_of_dataset",
    "throws_in_a_line",
    "write_lerobot",
    "write_summary",
]
