"""Compiled modules as the plain Python that they are written in."""

import importlib.util
from types import ModuleType

from tests.paths import ROOT


def interpreted(name: str) -> ModuleType:
    """A module of the library, such as `dart_skill.common.small_matrices`, as Python runs it where
    it was not compiled.

    What it imports from other modules is compiled all the same.
    """
    path = ROOT / (name.replace(".", "/") + ".py")
    spec = importlib.util.spec_from_file_location(f"{name}_interpreted", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
