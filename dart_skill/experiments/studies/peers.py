"""Other libraries beside which experiments and benchmarks measure ours; none of them is needed, or
comes with this one.
"""

from __future__ import annotations

import importlib
import sys
import types
from pathlib import Path
from typing import Any


def pbdlib_mixture(folder: str | Path) -> Any:
    """The class GMM of a checkout of pbdlib-python, without the plots and Gaussians that load with
    it, which are not used.

    pbdlib-python is no package: folder is its checkout for Python 3, in which pbdlib/gmm.py is.

    Raises
    ------
    ValueError
        It is not there.
    """
    package = Path(folder) / "pbdlib"
    if not (package / "gmm.py").is_file():
        raise ValueError(
            f"there is no pbdlib/gmm.py in {folder}: give the checkout of pbdlib-python"
        )
    _stand_in("pbdlib", __path__=[str(package)])
    _stand_in("pbdlib.utils", __path__=[str(package / "utils")])
    _stand_in("pbdlib.mvn", MVN=type("MVN", (), {}))
    _stand_in("pbdlib.plot", plot_gmm=None)
    if "termcolor" not in sys.modules:
        _stand_in("termcolor", colored=None)
    if (package / "utils" / "gaussian_utils.py").is_file():
        used = importlib.import_module("pbdlib.utils.gaussian_utils")
        vars(sys.modules["pbdlib.utils"])["gaussian_moment_matching"] = (
            used.gaussian_moment_matching
        )
    return importlib.import_module("pbdlib.gmm").GMM


def _stand_in(name: str, **content: object) -> None:
    sys.modules[name] = types.ModuleType(name)
    vars(sys.modules[name]).update(content)
