"""A report: one HTML page of a run, made from its bag, with tables, figures and a replay in three
dimensions; without ROS.
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use

if TYPE_CHECKING:
    from dart_skill.report._page import PAGE, page_of, write_page, write_report
    from dart_skill.report._pictures import pictures
    from dart_skill.report._replay import play
    from dart_skill.report._run import About, Movement, Phase, Run, read_run
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_page": "PAGE page_of write_page write_report",
            "_pictures": "pictures",
            "_replay": "play",
            "_run": "About Movement Phase Run read_run",
        },
    )

__all__ = [
    "About",
    "Movement",
    "PAGE",
    "Phase",
    "Run",
    "page_of",
    "pictures",
    "play",
    "read_run",
    "write_page",
    "write_report",
]
