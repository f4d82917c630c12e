"""What a file of config/ says where it is broken: the file, the place and the remedy."""

import pytest

from dart_skill.common.configuration import limit_parameters, load_yaml, node_parameters
from dart_skill.common.world import the_world

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 9)}]\n"
    for old, new in zip("abcdef", "bcdefg", strict=True)
)
"""A few lines that stand for 5 million entries."""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[" * 100_000, "line 1 is nested more than 30 deep"),
        ("a:\n\t- 1\n", "line 2, column 1: found character that cannot start any token"),
        ("a: [1, 2\nb: 3\n", "line 2, column 2: did not find expected ',' or ']'"),
        ("a: \x01", "character 4: control characters are not allowed"),
        ("- 1\n- 2\n", "holds no mapping: write one 'name: value' in a line"),
        ("", "holds no mapping"),
        ("a: 1\nb: {c: 2, d: 3, c: 4}\n", "line 2: c stands in line 2 already; keep one"),
        ("a: 1\nb: 2\na: 3\n", "line 3: a stands in line 1 already; keep one"),
        ("a: &a [*a]\n", "nested more than 30 deep"),
        (BOMB, "has more than 100000 entries, with its aliases"),
        ("a: !!python/object:os.system x\n", "could not determine a constructor for the tag"),
    ],
)
def test_a_file_that_is_no_mapping_is_named_with_the_place(edited, text, said):
    path = edited("world.yaml", None, text)
    with pytest.raises(ValueError, match="world.yaml") as error:
        load_yaml("world.yaml")
    assert str(path) in str(error.value) and said in str(error.value)
    assert "\n" not in str(error.value)


def test_bytes_that_are_no_text_are_said_to_be_none(edited):
    path = edited("world.yaml", None, "")
    path.write_bytes(b"a: \xff\xfe")
    with pytest.raises(ValueError, match=r"world.yaml is no YAML: 'utf-8' codec can't decode"):
        load_yaml("world.yaml")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("ball_mass: 0.0577", "ball_mass: text", "ball_mass is 'text'; it must be a number"),
        ("ball_mass: 0.0577", "ball_mass:", "ball_mass is None; it must be a number"),
        ("ball_mass: 0.0577", "ball_mass: .nan", "ball_mass is nan; it must be a number"),
        ("[2.37, 0.0, 1.73]", "[1e308, 0.0, 1.73]", "board_position[0] is '1e308'; it must be"),
        (
            "[2.37, 0.0, 1.73]",
            "[2.37, 0.0]",
            "board_position is [2.37, 0.0]; it must be a list of 3",
        ),
        ("    rim: 0.40 ", "    # ", "lacks rim"),
        ("    rim: 0.40 ", "    rim: 0.40\n    rims: 1.0 ", "'rims': did you mean rim?"),
        ("  ros__parameters:", "  hand: 3\n  ros__parameters:", "unknown entry 'hand'"),
        ("[2.37, 0.0, 1.73]", "[]", r"board_position is []"),
        ("frame_id: world", "frame_id: 3", "frame_id is 3; it must be a name"),
    ],
)
def test_a_value_of_the_world_that_is_none_is_refused_by_name(edited, old, new, said):
    edited("world.yaml", old, new)
    with pytest.raises(ValueError) as error:
        the_world()
    assert "world.yaml" in str(error.value) and said in str(error.value)


@pytest.mark.parametrize("value", ["fast", "true", "-1.0", "1.0e+308", "[1.5, x]"])
def test_a_number_out_of_the_range_that_is_described_is_refused(edited, value):
    edited("limits.yaml", "careful_hand: 1.5 ", f"careful_hand: {value} ")
    with pytest.raises(ValueError, match=r"limits.yaml: .*careful_hand is .* from 0.05 to 10"):
        limit_parameters()
    with pytest.raises(ValueError, match="careful_hand"):
        node_parameters("commander.yaml", "commander")


def test_a_section_without_parameters_is_refused(edited):
    edited("limits.yaml", None, "/**:\n  - 1\n")
    with pytest.raises(ValueError, match=r"limits.yaml: /\*\* is .*names with values"):
        limit_parameters()
