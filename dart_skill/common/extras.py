"""Packages that only a part of the library needs, and the extra of `pip install 'dart_skill[...]'`
that brings each.
"""

from __future__ import annotations

import importlib
import importlib.util
from types import ModuleType
from typing import NoReturn

EXTRA_OF = {
    "pinocchio": "sim",
    "pybullet": "sim",
    "pybullet_utils": "sim",
    "tqdm": "plot",
    "matplotlib": "plot",
    "viser": "view",
    "pyarrow": "lerobot",
    "av": "lerobot",
    "pandas": "pandas",
    "foxglove": "foxglove",
    "c3d": "c3d",
}
"""The extra that brings a module."""


def remedy(module: str) -> str:
    """What to type where a module is missing."""
    return f"pip install 'dart_skill[{EXTRA_OF[module]}]'"


def explained(error: ImportError) -> str:
    """An import that failed, in a line: what is missing, and what brings it, where that is an
    extra of ours.

    Parameters
    ----------
    error
        Of the import.
    """
    module = (error.name or "").split(".")[0]
    missing = isinstance(error, ModuleNotFoundError) and module in EXTRA_OF
    return (
        f"the package {module} is needed for this, and is not there: {remedy(module)}"
        if missing
        else str(error)
    )


def need(*modules: str) -> None:
    """ModuleNotFoundError for a module that is not there, before any work is begun."""
    for module in modules:
        if importlib.util.find_spec(module) is None:
            raise ModuleNotFoundError(f"No module named '{module}'", name=module)


def optional(module: str) -> ModuleType:
    """A module of a package that is in an extra.

    Raises
    ------
    ModuleNotFoundError
        As of an import, if it is not there.
    """
    return importlib.import_module(module)


class Absent:
    """Stands for a module that is not installed: what asks it for anything gets the error of
    its import.
    """

    def __init__(self, error: ModuleNotFoundError):
        self._error = error

    def __getattr__(self, name: str) -> NoReturn:
        raise self._error
