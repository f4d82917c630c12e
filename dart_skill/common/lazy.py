"""Packages whose names are imported when they are used first, so that a process loads what it needs
and no more (PEP 562).
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def attach(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list]:
    """A package's `__getattr__`, `__dir__` and `__all__`, from the stub beside its `__init__`.

    The stub, `__init__.pyi`, is what type checkers read, and the one place in which a name stands
    (as lazy_loader of Scientific Python has it, which ROS does not package):

        from dart_skill.movement._ds_gmr import DSGMR as DSGMR

    Parameters
    ----------
    package
        Its name.
    file
        Its `__init__.py`.

    Raises
    ------
    AttributeError
        By `__getattr__`, as of any module, for a name that the stub does not have.
    """
    tree = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    lines = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    home = {alias.name: str(line.module) for line in lines for alias in line.names}
    namespace = vars(sys.modules[package])

    def get(name: str) -> Any:
        if name not in home:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        namespace[name] = getattr(import_module(home[name]), name)
        return namespace[name]

    return get, lambda: sorted({*namespace, *home}), sorted(home)
