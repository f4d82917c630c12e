"""The examples of the documentation run as they stand; what they promise, they assert themselves."""

import ast
import importlib.util
import runpy
import warnings

import matplotlib
import matplotlib.pyplot as plt
import pytest

from tests.paths import DOCS, ROOT

EXAMPLES = sorted((DOCS / "examples").glob("*.py"))
NEEDS = {"plot_8_scikit_learn": "sklearn", "plot_4_searches": "cma"}


@pytest.fixture
def at_home(monkeypatch):
    """In the folder of the checkout, without a screen."""
    monkeypatch.chdir(ROOT)
    backend = matplotlib.get_backend()
    matplotlib.use("Agg")
    yield
    plt.close("all")
    matplotlib.use(backend)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_has_a_heading_for_the_gallery(example):
    """Else `make docs` fails: a formatter once joined heading and line into one."""
    _, heading, line, *_ = ast.get_docstring(ast.parse(example.read_text()), clean=False).split(
        "\n"
    )
    assert line == len(heading) * "=" and heading


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_draws(example, at_home):
    wanted = NEEDS.get(example.stem)
    if wanted and importlib.util.find_spec(wanted) is None:
        pytest.skip(f"{wanted} is not installed")
    with warnings.catch_warnings():
        # plt.show() without a screen
        warnings.filterwarnings("ignore", message=".*non-interactive.*")
        runpy.run_path(str(example))
    assert plt.get_fignums(), "it draws nothing"
