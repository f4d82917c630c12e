"""Habits of the code that no linter knows: absolute imports, `if` for a choice, and a line of its
own for each change of state.
"""

import ast
import re

import pytest

from tests.paths import ROOT

FOLDERS = (
    "dart_skill",
    "nodes",
    "launch",
    "tools",
    "benchmarks",
    "tests",
    "docs",
    "lerobot_policy_dsgmr",
    "lerobot_env_dart",
)


def is_relative_import(node):
    return isinstance(node, ast.ImportFrom) and node.level > 0


def is_choice_without_if(node):
    """`a() if c else b()` or `c and a()` as a statement."""
    return isinstance(node, ast.Expr) and isinstance(node.value, (ast.IfExp, ast.BoolOp))


def changes_state_beside_a_variable(node):
    """`taken, self._state = self._state, None`: an attribute changes on a line that is about
    something else.
    """
    if not (
        isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Tuple)
        and isinstance(node.value, ast.Tuple)
    ):
        return False
    return (
        len(
            {isinstance(target, (ast.Attribute, ast.Subscript)) for target in node.targets[0].elts}
        )
        == 2
    )


HABITS = {
    "imports are absolute": is_relative_import,
    "a choice is an if statement": is_choice_without_if,
    "an attribute is not assigned in one line with a variable": changes_state_beside_a_variable,
}
OF_TESTS_TOO = {"imports are absolute", "a choice is an if statement"}
LIKELY = re.compile(r"^ *from \.|^ *(await )?[\w.]+(\(.*\))? (if|and|or) ", re.MULTILINE)
ASSIGNS = re.compile(r"^ +(?=[^=\n]*\w\.\w)[^=\n]*, [^=\n]*= ", re.MULTILINE)
"""Lines as in a module that breaks a habit: to parse all modules takes four seconds."""


def broken(source):
    """(habit, line) of every habit that a module breaks."""
    return [
        (habit, node.lineno)
        for node in ast.walk(ast.parse(source))
        for habit, breaks in HABITS.items()
        if breaks(node)
    ]


@pytest.mark.parametrize(
    ("line", "habit"),
    [
        ("from .conftest import graphs", "imports are absolute"),
        ("go() if there else None", "a choice is an if statement"),
        ("there and go()", "a choice is an if statement"),
        (
            "taken, self.waiting = self.waiting, []",
            "an attribute is not assigned in one line with a variable",
        ),
        ("self.a, self.b = 0, 0", None),
        ("a, b = b, a", None),
        ("self.a = 1 if there else 2", None),
        ("a, self.b = both()", None),
    ],
)
def test_what_breaks_a_habit_is_found(line, habit):
    assert [name for name, _ in broken(line)] == ([habit] if habit else [])
    assert LIKELY.search(line) or ASSIGNS.search(f"    {line}") or not habit


def test_all_modules_keep_the_habits():
    found = []
    for path in (path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))):
        of_tests, source = path.is_relative_to(ROOT / "tests"), path.read_text(encoding="utf-8")
        if not (LIKELY.search(source) or (ASSIGNS.search(source) and not of_tests)):
            continue
        for habit, number in broken(source):
            if habit in OF_TESTS_TOO or not of_tests:
                found.append(f"{path.relative_to(ROOT)}:{number}: {habit}")
    assert not found, "\n".join(found)


QUATERNIONS = re.compile(
    r"def _?(rotate|multiply|hamilton)\w*\(|\w+ \* \w+ - x\w* \* x\w* - y\w* \* y\w* - z"
)
WITH_QUATERNIONS = {
    "dart_skill/common/quaternions.py": "the one place",
    "dart_skill/movement/_orientation.py": "checks what a caller of the library gives",
}


def test_quaternions_are_multiplied_in_one_module():
    files = [path for folder in ("dart_skill", "nodes") for path in (ROOT / folder).rglob("*.py")]
    found = {
        path.relative_to(ROOT).as_posix()
        for path in files
        if QUATERNIONS.search(path.read_text(encoding="utf-8"))
    }
    assert found == set(WITH_QUATERNIONS)


A_GRIP_AS_A_NUMBER = re.compile(
    r"^_?(OPEN = 2|CLOSE = 1)\b|grip['\"\]]* ?(==|!=|:) ?\d", re.MULTILINE
)


def test_what_the_hand_shall_do_is_no_bare_number():
    """`grip == 2` says nothing to a reader; `Grip.OPEN` of `dart_skill.common.constants` does."""
    files = [
        path
        for folder in ("dart_skill", "nodes", "tools", "launch")
        for path in (ROOT / folder).rglob("*.py")
    ]
    assert not [
        path for path in files if A_GRIP_AS_A_NUMBER.search(path.read_text(encoding="utf-8"))
    ]
    assert all(
        A_GRIP_AS_A_NUMBER.search(line)
        for line in ("OPEN = 2", "if command.grip == 2:", '{"grip": 2}', "row['grip'] != 1")
    )


def test_no_private_name_is_imported_from_another_module():
    """Modules whose names begin with an underscore are parts of their package; functions and
    classes with one are not.
    """
    paths = [path for folder in ("dart_skill", "nodes") for path in (ROOT / folder).rglob("*.py")]
    modules = {path.stem for path in paths}
    imported = [
        (path.relative_to(ROOT), name.name)
        for path in paths
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("dart_skill")
        for name in node.names
    ]
    assert len(imported) > 1000
    assert not [
        one
        for one in imported
        if one[1].startswith("_") and not one[1].startswith("__") and one[1] not in modules
    ]
