"""The code keeps to what NumPy 1.26, SciPy 1.11 and Matplotlib 3.7 know, the oldest that it takes;
tests usually run with newer ones.

Names and arguments that came later are looked for in the text of all modules.
`tests/unit/conftest.py` watches the calls of `numpy.linalg.solve`, whose meaning has changed.
"""

import re

import numpy as np
import pytest

from tests.paths import ROOT

FOLDERS = ("dart_skill", "nodes", "launch", "tools", "benchmarks", "tests", "docs")
NUMPY_2 = (
    "acosh? asinh? atan[2h]? astype bitwise_(count|invert|left_shift|right_shift) bool concat"
    " cumulative_(prod|sum) isdtype long matrix_transpose matvec permute_dims pow strings"
    " trapezoid ulong unique_(all|counts|inverse|values) unstack vecdot vecmat"
).split()
NUMPY_2_LINALG = (
    "cross diagonal matmul matrix_norm matrix_transpose outer svdvals tensordot trace vecdot"
    " vector_norm".split()
)
LATER_SCIPY = (
    "RigidTransform cubature cumulative_simpson lebedev_rule tanhsinh make_spl(rep|prep)"
    " generate_knots NdBSpline AAA isotonic_regression FloaterHormannInterpolator"
    " vectorized_filter softplus stirling2 ShortTimeFFT"
).split()
NEW = re.compile(
    rf"\bnp\.({'|'.join(NUMPY_2)})\b|\blinalg\.({'|'.join(NUMPY_2_LINALG)})\b|\bscipy\b.*\b({'|'.join(LATER_SCIPY)})\b"
    r"|\.(as|from)_davenport\b|\bscalar_first=|\.mT\b|\bcopy=None\b|\bdevice="
    r"|\bnp\.(nan)?(quantile|percentile)\(.*\bweights=|\bnp\.(nan)?(std|var)\(.*\b(correction|mean)=|\bpinv\(.*\brtol="
    r"|\bnp\.savez(_compressed)?\(.*\ballow_pickle="  # which NumPy 1.26 would save as an array
    r"|color=\([^,()]+, [^,()]+\)"  # a colour and its opacity: Matplotlib 3.8
)


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("np.concat([a, b])", True),
        ("np.atan2(y, x)", True),
        ("np.linalg.vecdot(a, b)", True),
        ("np.asarray(a, copy=None)", True),
        ("a @ b.mT", True),
        ("np.quantile(values, [0.1, 0.9], weights=shares)", True),
        ("np.savez(file, allow_pickle=False)", True),
        ("rotation.as_quat(scalar_first=True)", True),
        ("from scipy.optimize import isotonic_regression, minimize", True),
        ("scipy.integrate.tanhsinh(f, 0, 1)", True),
        ("Ellipse(centre, 1.0, 2.0, facecolor=(colour, fullness[k]))", True),
        ("Ellipse(centre, 1.0, 2.0, facecolor=(0.5, 0.5, 0.5))", False),
        ("from dart_skill.recording.imports import RigidTransform", False),
        ("np.concatenate([a, b])", False),
        ("np.arctan2(y, x)", False),
        ("np.bool_", False),
        ("np.power(a, b)", False),
        ("np.load(file, allow_pickle=False)", False),
        ("np.average(values, weights=shares)", False),
    ],
)
def test_what_is_newer_is_found(line, found):
    assert bool(NEW.search(line)) == found


def test_all_modules_do_with_the_oldest_numpy_scipy_and_matplotlib():
    modules = (
        path
        for folder in FOLDERS
        for path in sorted((ROOT / folder).rglob("*.py"))
        if path.name != "test_numpy_versions.py"
    )
    found = [
        f"{path.relative_to(ROOT)}:{number}: {new.group()}"
        for path in modules
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if (new := NEW.search(line))
    ]
    assert not found, "NumPy 1.26, SciPy 1.11 or Matplotlib 3.7 does not have it:\n" + "\n".join(
        found
    )


STACK, ONE = np.broadcast_to(np.eye(3), (3, 3, 3)), np.eye(3)


@pytest.mark.parametrize(
    ("left", "right"),
    [(STACK, ONE), (STACK, ONE[0]), (STACK[None], STACK)],
    ids=["matrix", "vector", "stack"],
)
def test_a_right_side_with_two_meanings_is_refused(left, right):
    """NumPy 1.26 takes one dimension less for a stack of vectors, NumPy 2 for a matrix for all,
    and a single vector for one for all.
    """
    with pytest.raises(AssertionError, match=r"right\[None\]"):
        np.linalg.solve(left, right)


@pytest.mark.parametrize(
    ("left", "right"),
    [(STACK, STACK), (STACK, ONE[None]), (STACK, STACK[..., :1]), (ONE, ONE), (ONE, ONE[0])],
)
def test_a_right_side_with_one_meaning_is_solved(left, right):
    solved = np.linalg.solve(left, right)
    np.testing.assert_array_equal(solved, np.broadcast_to(right, solved.shape))
