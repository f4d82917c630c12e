"""What a file of config/ says where it is broken: the file, the place and the remedy."""

import shutil

import pytest

from dart_skill.common import configuration
from dart_skill.common.configuration import limit_parameters, load_yaml, node_parameters
from dart_skill.common.world import the_world

CONFIG = configuration.config_path("world.yaml").parent


@pytest.fixture
def edited(tmp_path, monkeypatch):
    """A function that replaces a text in a file of a copy of config/; None: the whole of it."""
    folders = [CONFIG]

    def edit(name, old, new):
        # another folder each time: what is read of one is remembered
        folder = tmp_path / f"config_{len(folders)}"
        shutil.copytree(folders[-1], folder)
        folders.append(folder)
        monkeypatch.setenv("DART_SKILL_CONFIG", str(folder))
        path = folder / name
        text = path.read_text(encoding="utf-8")
        assert old is None or text.count(old) == 1
        path.write_text(new if old is None else text.replace(old, new), encoding="utf-8")
        return path

    return edit


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[" * 100_000, "line 1 is nested more than 30 deep"),
        ("a:\n\t- 1\n", "line 2, column 1: found character that cannot start any token"),
        ("a: [1, 2\nb: 3\n", "line 2, column 2: did not find expected ',' or ']'"),
        ("a: \x01", "character 4: control characters are not allowed"),
        ("- 1\n- 2\n", "holds no mapping: write one 'name: value' in a line"),
        ("", "holds no mapping"),
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
        ("[2.37, 0.0, 1.73]", "[1e308, 0.0, 1.73]", "board_position is ['1e308', 0.0, 1.73]"),
        ("[2.37, 0.0, 1.73]", "[]", r"board_position is []"),
        ("frame_id: world", "frame_id: 3", "frame_id is 3; it must be a name"),
    ],
)
def test_a_value_of_the_world_that_is_none_is_refused_by_name(edited, old, new, said):
    edited("world.yaml", old, new)
    with pytest.raises(ValueError) as error:
        the_world()
    assert "world.yaml: " in str(error.value) and said in str(error.value)


@pytest.mark.parametrize("value", ["fast", "true", "-1.0", "1.0e+308", "[1.5, x]"])
def test_a_number_out_of_the_range_that_is_described_is_refused(edited, value):
    edited("limits.yaml", "careful_hand: 1.5 ", f"careful_hand: {value} ")
    with pytest.raises(ValueError, match=r"limits.yaml: careful_hand is .* from 0.05 to 10"):
        limit_parameters()
    with pytest.raises(ValueError, match="careful_hand"):
        node_parameters("commander.yaml", "commander")


def test_a_section_without_parameters_is_refused(edited):
    edited("limits.yaml", None, "/**:\n  - 1\n")
    with pytest.raises(ValueError, match=r"limits.yaml: '/\*\*' has no mapping 'ros__parameters'"):
        limit_parameters()
