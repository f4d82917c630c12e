"""Modules that have a .pxd beside them are compiled, and what was compiled is what stands there
now.
"""

import importlib
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

from tests.paths import ROOT

TYPED = sorted(
    path.relative_to(ROOT).with_suffix("") for path in (ROOT / "dart_skill").rglob("*.pxd")
)
REMEDY = "python3 setup.py build_ext --inplace"


@pytest.mark.parametrize("module", TYPED, ids=lambda path: path.name)
def test_what_runs_was_compiled_from_what_stands_there(module):
    loaded = importlib.import_module(".".join(module.parts)).__file__
    assert loaded.endswith(tuple(EXTENSION_SUFFIXES)), f"{module}.py is not compiled: {REMEDY}"
    changed = max((ROOT / f"{module}{suffix}").stat().st_mtime for suffix in (".py", ".pxd"))
    assert Path(loaded).stat().st_mtime >= changed, (
        f"{module}.py has changed since it was compiled: {REMEDY}"
    )
