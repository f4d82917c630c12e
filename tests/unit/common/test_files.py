"""Files are there whole or not at all, and what is no file is not waited for."""

import os

import pytest

from dart_skill.common.files import NoFile, new_file, open_file


def test_a_file_is_there_when_it_is_whole(tmp_path):
    with new_file(tmp_path / "a") as file:
        file.write(b"whole")
        assert not (tmp_path / "a").exists()
    assert (tmp_path / "a").read_bytes() == b"whole" and os.listdir(tmp_path) == ["a"]


@pytest.mark.parametrize("replace", [False, True])
def test_what_fails_leaves_nothing_behind_and_what_was_there_as_it_was(tmp_path, replace):
    if replace:
        (tmp_path / "a").write_bytes(b"before")
    with pytest.raises(OSError, match="No space"), new_file(tmp_path / "a", replace) as file:
        file.write(b"half")
        raise OSError(28, "No space left on device")
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"before"] * replace


def test_a_file_is_replaced_only_if_that_is_meant(tmp_path):
    (tmp_path / "a").write_bytes(b"before")
    with pytest.raises(FileExistsError, match="a exists already"), new_file(tmp_path / "a"):
        pass
    with new_file(tmp_path / "a", replace=True) as file:
        file.write(b"after")
    assert (tmp_path / "a").read_bytes() == b"after"


def test_one_that_came_meanwhile_is_not_overwritten(tmp_path):
    with pytest.raises(FileExistsError), new_file(tmp_path / "a") as file:
        file.write(b"mine")
        (tmp_path / "a").write_bytes(b"theirs")
    assert (tmp_path / "a").read_bytes() == b"theirs" and os.listdir(tmp_path) == ["a"]


def test_only_files_are_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path, what in (
        (tmp_path / "pipe", "a named pipe"),
        (tmp_path, "a folder"),
        ("/dev/null", "a device"),
    ):
        with pytest.raises(NoFile, match=f"is {what}, and not a file"):
            open_file(path)
    with pytest.raises(FileNotFoundError):
        open_file(tmp_path / "nothing")
    with pytest.raises(ValueError, match="is no path"):
        open_file("a\0b")


def test_a_disk_that_is_full_is_told_with_the_file_that_was_to_be_written(tmp_path):
    with (
        pytest.raises(OSError, match=r"No space left on device: '.*page\.html'"),
        new_file(tmp_path / "page.html") as stream,
    ):
        with open("/dev/full", "wb", buffering=0) as full:
            full.write(stream.name.encode())
    assert not list(tmp_path.iterdir())
