"""docs/equations.md names functions that there are, and its equations can be set."""

import pkgutil
import re

import pytest
from docutils.utils.math.latex2mathml import tex2mathml

from tests.paths import DOCS

TEXT = (DOCS / "equations.md").read_text(encoding="utf-8")
NAMES = sorted(set(re.findall(r"`(dart_skill\.[\w.]+)`", TEXT)))
EQUATIONS = re.findall(r"\$\$(.+?)\$\$", TEXT, re.DOTALL) + re.findall(
    r"(?<!\$)\$([^$\n]+)\$(?!\$)", TEXT
)


@pytest.mark.parametrize("name", NAMES)
def test_what_computes_an_equation_is_there(name):
    assert callable(pkgutil.resolve_name(name))


def test_every_equation_can_be_set():
    assert len(EQUATIONS) > 30
    for equation in EQUATIONS:
        assert tex2mathml(equation).startswith("<math")
