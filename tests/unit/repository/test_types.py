"""mypy finds wrong calls of the library, with the settings of pyproject.toml, and has nothing to say about right ones."""

import importlib.util
import re
import subprocess
import sys

import pytest

from tests.paths import ROOT

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("mypy") is None, reason="mypy is not installed here: pip install -r requirements/test.txt, or make setup"
)

IMPORTS = """\
import numpy as np
from dart_skill.darts import Spread, best_aim
from dart_skill.flight import fit_flight, landing
from dart_skill.mixture import GaussianMixture
from dart_skill.policy_search import PoWER
from dart_skill.session import Session
"""
RIGHT = """\
place: np.ndarray = landing(np.zeros(3), np.ones(3), -1.0).position
mixture: GaussianMixture = GaussianMixture(2).fit([[0.0], [1.0]], rng=np.random.default_rng(0))
search: PoWER = PoWER.load("search.json")
score: float = best_aim(Spread.isotropic(10.0)).expected_score
"""
WRONG = {
    'landing("high", np.ones(3), 0.0)': "arg-type",  # a str for an array
    "fit_flight(np.zeros(3))": "call-arg",  # a missing argument
    "GaussianMixture(n_parts=2)": "call-arg",  # an argument that there is not
    'GaussianMixture("two")': "arg-type",
    "Spread.isotropic([10.0])": "arg-type",
    "Session(seed=1).throw(np.zeros(3))": "arg-type",  # a target for a plan
    "best_aim(10.0).expected_scores": "attr-defined",
    "print(PoWER(np.zeros(2), 1.0, rng=np.random.default_rng(0)).best_trial.number)": "union-attr",  # there may be none
}


def errors_of(folder, lines):
    """Codes of the errors that mypy finds in some lines after the imports, by the number of the line."""
    file = folder / "calls.py"
    file.write_text(IMPORTS + "\n".join(lines) + "\n")
    command = [sys.executable, "-m", "mypy", "--hide-error-context", "--no-error-summary", str(file)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    found = re.findall(r"calls\.py:(\d+): error: .*\[([\w-]+)\]", done.stdout)
    assert bool(found) == bool(done.returncode), done.stdout
    return {int(line) - IMPORTS.count("\n") - 1: code for line, code in found}


def test_wrong_calls_are_found_and_right_ones_pass(tmp_path):
    right = RIGHT.splitlines()
    wrong = dict(enumerate(WRONG.values(), start=len(right)))
    assert errors_of(tmp_path, [*right, *WRONG]) == wrong
