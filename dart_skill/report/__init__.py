"""A report: one HTML page of a run, made from its bag, with tables, figures and a replay in three
dimensions; without ROS.
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use

if TYPE_CHECKING:
    from dart_skill.report._page import page_of
    from dart_skill.report._pictures import pictures
    from dart_skill.report._replay import play
    from dart_skill.report._run import About, Phase, Run, read_run
    from dart_skill.report._skill_page import skill_page_of, skill_pictures
    from dart_skill.report._skill_run import SkillRun, read_skill_run
    from dart_skill.report._writing import PAGE, write_page, write_report, write_skill_report
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_page": "page_of",
            "_pictures": "pictures",
            "_replay": "play",
            "_run": "About Phase Run read_run",
            "_skill_page": "skill_page_of skill_pictures",
            "_skill_run": "SkillRun read_skill_run",
            "_writing": "PAGE write_page write_report write_skill_report",
        },
    )

__all__ = [
    "Run",
    "About",
    "PAGE",
    "Phase",
    "page_of",
    "pictures",
    "play",
    "SkillRun",
    "read_run",
    "read_skill_run",
    "skill_page_of",
    "skill_pictures",
    "write_page",
    "write_report",
    "write_skill_report",
]
