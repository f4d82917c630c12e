"""Teaching, learning and throwing in one process without ROS, learning from a bag, and what a run
amounts to.
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use
from dart_skill.session._skill_summary import (
    SkillResult,
    SkillSummary,
    in_words,
    situation_json,
    skill_table,
)
from dart_skill.session._summary import (
    DemoSummary,
    ThrowResult,
    basket_in_words,
    error_quantile,
    footer,
    table,
    throw_in_words,
    write_summary,
)

if TYPE_CHECKING:
    from dart_skill.session._auto_mapping import auto_mapping
    from dart_skill.session._belt import BeltSession
    from dart_skill.session._bench import BenchSession
    from dart_skill.session._darts_demo import Hit, darts_demo, play_leg, throw_dart
    from dart_skill.session._darts_run import (
        BLOCK,
        Dart,
        DartsRun,
        DartsSummary,
        LegSummary,
        after_the_throw,
        as_pair,
        before_the_throw,
        darts_json,
        darts_table,
        summarise,
    )
    from dart_skill.session._demo import Job, throwing_demo
    from dart_skill.session._disagreement import Cause, Disagreement, disagreement
    from dart_skill.session._finding import find_throws
    from dart_skill.session._from_bag import LearnReport, NothingLearned, learn_from_bag
    from dart_skill.session._from_lerobot import (
        learn_throws_from_dataset,
        open_dataset,
        skill_of_dataset,
    )
    from dart_skill.session._in_process import Session, Trial
    from dart_skill.session._reaching_person import ReachingPerson
    from dart_skill.session._recorded_lessons import learn_skill
    from dart_skill.session._session_bag import LAYOUT, SessionBag
    from dart_skill.session._skill_demo import skill_demo
    from dart_skill.session._skill_session import SkillSession, SkillTrial
    from dart_skill.session._to_lerobot import FPS, ExportedDataset, PictureMaker, write_lerobot
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_auto_mapping": "auto_mapping",
            "_belt": "BeltSession",
            "_bench": "BenchSession",
            "_darts_demo": "Hit darts_demo play_leg throw_dart",
            "_darts_run": (
                "BLOCK Dart DartsRun DartsSummary LegSummary after_the_throw as_pair"
                " before_the_throw darts_json darts_table summarise"
            ),
            "_demo": "Job throwing_demo",
            "_disagreement": "Cause Disagreement disagreement",
            "_finding": "find_throws",
            "_from_bag": "LearnReport NothingLearned learn_from_bag",
            "_from_lerobot": ("learn_throws_from_dataset open_dataset skill_of_dataset"),
            "_in_process": "Session Trial",
            "_reaching_person": "ReachingPerson",
            "_session_bag": "LAYOUT SessionBag",
            "_skill_demo": "skill_demo",
            "_recorded_lessons": "learn_skill",
            "_skill_session": "SkillSession SkillTrial",
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
    "DartsSummary",
    "Hit",
    "Job",
    "LAYOUT",
    "LegSummary",
    "LearnReport",
    "DemoSummary",
    "Disagreement",
    "ExportedDataset",
    "FPS",
    "PictureMaker",
    "Session",
    "SessionBag",
    "SkillSummary",
    "ReachingPerson",
    "SkillResult",
    "SkillSession",
    "SkillTrial",
    "ThrowResult",
    "NothingLearned",
    "Trial",
    "after_the_throw",
    "as_pair",
    "auto_mapping",
    "basket_in_words",
    "before_the_throw",
    "darts_demo",
    "darts_json",
    "darts_table",
    "disagreement",
    "error_quantile",
    "find_throws",
    "footer",
    "in_words",
    "learn_from_bag",
    "learn_skill",
    "learn_throws_from_dataset",
    "open_dataset",
    "play_leg",
    "situation_json",
    "skill_demo",
    "skill_of_dataset",
    "skill_table",
    "summarise",
    "table",
    "throw_dart",
    "throw_in_words",
    "throwing_demo",
    "write_lerobot",
    "write_summary",
]
