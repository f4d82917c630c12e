"""Names of a package that are imported when they are used first, so that a process loads what it
needs and no more (PEP 562).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def on_first_use(
    package: str, home: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """A package's `__getattr__` and `__dir__`, which import names from the modules that have them
    when somebody asks for them.

    A type checker sees the imports themselves:

        if TYPE_CHECKING:
            from package._heavy import Heavy, HeavyResult
        else:
            __getattr__, __dir__ = on_first_use(__name__, {"_heavy": "Heavy HeavyResult"})

    Parameters
    ----------
    package
        Its name.
    home
        For each module of the package the names that it has, with spaces between.

    Raises
    ------
    AttributeError
        As of any module, for a name that none of them has.
    """
    module_of = {name: module for module, names in home.items() for name in names.split()}
    namespace = vars(sys.modules[package])

    def get(name: str) -> Any:
        if name not in module_of:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        namespace[name] = getattr(import_module(f"{package}.{module_of[name]}"), name)
        return namespace[name]

    return get, lambda: sorted({*namespace, *module_of})
