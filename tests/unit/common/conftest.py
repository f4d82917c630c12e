"""A copy of config/ with a change."""

import shutil

import pytest

from dart_skill.common.configuration import config_path

CONFIG = config_path("world.yaml").parent


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
