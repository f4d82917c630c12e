"""The package of somebody else who has skills of their own, installed as a development install
does it.
"""

import shutil
import subprocess
import sys

from tests.paths import ROOT

EXAMPLE = ROOT / "tests" / "example_package"


def install_example(folder):
    """A copy of the example package with its metadata; the folder that must be on the path."""
    shutil.copytree(EXAMPLE, folder)
    return with_metadata(folder)


def with_metadata(folder):
    """The folder of a package, to which a development install adds its metadata."""
    subprocess.run(
        [sys.executable, "-c", "import setuptools; setuptools.setup()", "--quiet", "egg_info"],
        cwd=folder,
        check=True,
    )
    return folder
