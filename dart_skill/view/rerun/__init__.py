"""Bags in Rerun: finding it, a layout that fits the bag, the call, and the page for a browser."""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use

if TYPE_CHECKING:
    from dart_skill.view.rerun._bag import (
        ENVIRONMENT,
        RERUN_PORT,
        SIZE,
        VARIABLE,
        VERSION,
        BagLayout,
        Ports,
        RerunUnavailable,
        command_line,
        describe,
        find_rerun,
        free_ports,
        install,
        interpreter_of,
        quiet_environment,
        url_of_page,
        with_durations,
        workspace,
        write_layouts,
    )
    from dart_skill.view.rerun._page import RerunPage
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_bag": (
                "ENVIRONMENT RERUN_PORT SIZE VARIABLE VERSION BagLayout Ports RerunUnavailable"
                " command_line describe find_rerun free_ports install interpreter_of"
                " quiet_environment url_of_page with_durations workspace write_layouts"
            ),
            "_page": "RerunPage",
        },
    )

__all__ = [
    "ENVIRONMENT",
    "RERUN_PORT",
    "SIZE",
    "VARIABLE",
    "VERSION",
    "BagLayout",
    "Ports",
    "RerunPage",
    "RerunUnavailable",
    "command_line",
    "describe",
    "find_rerun",
    "free_ports",
    "install",
    "interpreter_of",
    "quiet_environment",
    "url_of_page",
    "with_durations",
    "workspace",
    "write_layouts",
]
