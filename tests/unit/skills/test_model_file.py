"""A model on disk: the same plan after loading, and nothing but a model is accepted."""

import contextlib
import io
import os
import pickle
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dart_skill.arm import KnownRegistration, Registration, same_plan
from dart_skill.common import archive
from dart_skill.common.configuration import ARM_VARIABLE
from dart_skill.common.situation import Situation
from dart_skill.skills.learning import (
    CONFIGURATIONS,
    DEFAULT,
    configuration,
    learn_throwing,
    load_model,
    save_model,
)
from tests.throw_demonstrations import assert_same

BASKET = np.array([1.8, 0.1, 0.4])


@pytest.fixture
def saved(tmp_path, demonstrations):
    path = tmp_path / "throw.npz"
    save_model(path, demonstrations, DEFAULT)
    return path


@pytest.fixture(scope="module")
def whole_model(tmp_path_factory, demonstrations):
    """Bytes of a model of one demonstration."""
    path = tmp_path_factory.mktemp("whole") / "throw.npz"
    save_model(path, demonstrations[:1], DEFAULT)
    return path.read_bytes()


def test_a_loaded_model_plans_the_same_throw_to_the_last_bit(saved, demonstrations):
    loaded, settings, *_ = load_model(saved)
    assert settings == DEFAULT
    assert same_plan(
        learn_throwing(loaded, settings).plan(BASKET),
        learn_throwing(demonstrations).plan(BASKET),
    )


def test_a_configuration_of_ones_own_keeps_its_name(tmp_path, demonstrations):
    its = {
        "board": (2.37, 0.0, 1.73),
        "registration": KnownRegistration(Registration(delay=0.004), (0.003,) * 13),
    }
    for k, own in enumerate(
        (replace(DEFAULT, components=9), replace(configuration("intervals"), name="mine", **its))
    ):
        save_model(tmp_path / f"{k}.npz", demonstrations[:1], own)
        assert load_model(tmp_path / f"{k}.npz")[1] == own


def test_demonstrations_come_back_as_they_were(saved, demonstrations):
    loaded, *_ = load_model(saved)
    assert len(loaded) == len(demonstrations)
    for original, copy in zip(demonstrations, loaded, strict=True):
        assert_same(original, copy)


def test_numbers_of_a_situation_come_back(tmp_path, demonstrations):
    poses = demonstrations[0].situation.poses
    heavy = replace(demonstrations[0], situation=Situation(poses, {"mass": 0.3}))
    save_model(tmp_path / "one.npz", [heavy], DEFAULT)
    assert_same(heavy, load_model(tmp_path / "one.npz").demonstrations[0])


def test_unknown_events_and_joint_names_come_back(tmp_path, demonstrations):
    names = tuple(f"wam_j{k}" for k in range(1, 8))
    original = replace(demonstrations[0], events=(), joint_names=names, id="throw ünïcode")
    save_model(tmp_path / "one.npz", [original], DEFAULT)
    (copy,), *_ = load_model(tmp_path / "one.npz")
    assert np.isnan(copy.opened) and copy.joint_names == names and copy.id == original.id


@pytest.mark.parametrize("name", sorted(CONFIGURATIONS))
def test_every_configuration_comes_back(tmp_path, demonstrations, name):
    save_model(tmp_path / "one.npz", demonstrations[:1], configuration(name))
    assert load_model(tmp_path / "one.npz")[1] == configuration(name)


def test_a_measured_registration_goes_with_the_model_and_into_its_name(tmp_path, demonstrations):
    measured = KnownRegistration(Registration(shift=(0.0, 0.03, 0.0), delay=0.004), (0.003,) * 13)
    chosen = replace(DEFAULT, registration=measured)
    save_model(tmp_path / "throw.npz", demonstrations, chosen)
    loaded, settings, *_ = load_model(tmp_path / "throw.npz")
    assert settings == chosen
    skill, plain = learn_throwing(loaded, settings), learn_throwing(demonstrations)
    assert same_plan(skill.plan(BASKET), learn_throwing(demonstrations, chosen).plan(BASKET))
    assert skill.model_id != plain.model_id and skill.registration != plain.registration
    assert skill.registration.shift[1] > plain.registration.shift[1] + 0.001


def test_an_existing_file_is_never_overwritten(saved, demonstrations):
    before = saved.read_bytes()
    with pytest.raises(FileExistsError):
        save_model(saved, demonstrations[:1], DEFAULT)
    assert saved.read_bytes() == before


def test_a_folder_that_is_not_there_is_named(tmp_path, demonstrations):
    with pytest.raises(FileNotFoundError, match="no folder .*nowhere to save a model in"):
        save_model(tmp_path / "nowhere" / "one.npz", demonstrations, DEFAULT)


def npz(**content):
    buffer = io.BytesIO()
    np.savez(buffer, **content)
    return buffer.getvalue()


def npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


GARBAGE = {
    "empty": b"",
    "text": b"this is not a model\n",
    "zip magic": b"PK\x03\x04 and then nothing",
    "pickle": pickle.dumps({"format": "dart_skill model 1"}),
    "one array": npy(np.zeros(3)),
    "other archive": npz(a=np.zeros(3)),
    "other format": npz(format=np.array("dart_skill model 99"), configuration=np.array("{}")),
    "no configuration": npz(format=np.array("dart_skill model 1")),
    "configuration of another version": npz(
        format=np.array("dart_skill model 1"), configuration=np.array('{"colour": "red"}')
    ),
    "configuration that is no JSON": npz(
        format=np.array("dart_skill model 1"), configuration=np.array("{")
    ),
    "demonstration without fields": npz(
        **{
            "format": np.array("dart_skill model 1"),
            "configuration": np.array("{}"),
            "0000.id": np.array("x"),
        }
    ),
}


@pytest.mark.parametrize("kind", GARBAGE)
def test_what_is_no_model_is_refused_by_name(tmp_path, kind):
    path = tmp_path / "garbage.npz"
    path.write_bytes(GARBAGE[kind])
    with pytest.raises(ValueError, match="garbage.npz is not a model file of dart_skill"):
        load_model(path)


def test_another_version_is_named(saved):
    content = dict(np.load(saved))
    content["format"] = np.array("dart_skill model 7")
    np.savez(saved, **content)
    with pytest.raises(
        ValueError,
        match="it has version 7, and this dart_skill reads version 4: learn from the bag again",
    ):
        load_model(saved)


def test_a_model_of_another_arm_is_refused_by_name(saved, monkeypatch):
    monkeypatch.setenv(ARM_VARIABLE, "iiwa7")
    with pytest.raises(
        ValueError, match="learned on the arm 'wam', and this is 'iiwa7'.*--arm wam"
    ):
        load_model(saved)


def test_no_memory_is_taken_for_what_an_array_only_says_of_itself(saved):
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"descr": "<f8", "fortran_order": False, "shape": (10**13, 3)}
    )
    with zipfile.ZipFile(saved, "a") as archive:
        archive.writestr("0000.more.npy", head.getvalue() + bytes(100))
    with pytest.raises(ValueError, match="says that it has the shape"):
        load_model(saved)


def test_a_model_that_would_fill_the_memory_is_refused_before_it_does(saved, monkeypatch):
    monkeypatch.setattr(archive, "LARGEST", 1000)
    with pytest.raises(ValueError, match="more than the 1000 that a model may have"):
        load_model(saved)


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "model")
    with pytest.raises(OSError, match="model is a named pipe, and not a file"):
        load_model(tmp_path / "model")


def test_a_full_disk_leaves_no_half_a_model(tmp_path, demonstrations, monkeypatch):
    def full(file, **arrays):
        file.write(b"PK half a model")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(OSError, match="No space left"):
        save_model(tmp_path / "throw.npz", demonstrations, DEFAULT)
    assert not list(tmp_path.iterdir())


@given(st.integers(0, 10**9), st.integers(1, 255))
def test_any_changed_byte_is_refused_or_changes_nothing(
    whole_model, tmp_path_factory, place, change
):
    content = bytearray(whole_model)
    content[place % len(content)] ^= change
    path = tmp_path_factory.getbasetemp() / "changed.npz"
    path.write_bytes(bytes(content))
    with contextlib.suppress(ValueError):
        load_model(path)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_a_file_that_was_cut_short_is_refused(saved, share):
    content = saved.read_bytes()
    saved.write_bytes(content[: int(share * len(content))])
    with pytest.raises(ValueError, match="is not a model file"):
        load_model(saved)


def test_a_file_whose_bytes_were_changed_is_refused(saved):
    content = bytearray(saved.read_bytes())
    middle = len(content) // 3
    content[middle : middle + 200] = bytes(200)
    saved.write_bytes(bytes(content))
    with pytest.raises(ValueError, match="is not a model file"):
        load_model(saved)


class Trap:
    """Would run code if it were unpickled."""

    def __reduce__(self):
        return (pytest.fail, ("a pickle was opened",))


def test_no_pickle_is_opened(saved):
    """Neither a whole pickle nor an object array inside an otherwise good model."""
    content = dict(np.load(saved))
    content["0000.hand_position"] = np.array([Trap()], dtype=object)
    with open(saved, "wb") as file:
        np.savez(file, **content)
    with pytest.raises(ValueError, match="is not a model file"):
        load_model(saved)
    saved.write_bytes(pickle.dumps(Trap()))
    with pytest.raises(ValueError, match="is not a model file"):
        load_model(saved)


def test_a_model_file_holds_plain_arrays_only(saved):
    with zipfile.ZipFile(saved) as archive:
        assert all(name.endswith(".npy") for name in archive.namelist())
    with np.load(saved, allow_pickle=False) as archive:
        assert all(archive[name].dtype != object for name in archive.files)


def test_a_file_that_is_not_there_is_not_found(tmp_path):
    with pytest.raises(FileNotFoundError):
        load_model(tmp_path / "nothing.npz")


def test_more_than_a_model_may_have_is_refused_before_anything_is_written(
    tmp_path, demonstrations, monkeypatch
):
    monkeypatch.setattr(archive, "LARGEST", 100_000)
    with pytest.raises(
        ValueError,
        match="more than the 100000 that a model may have: learn from fewer demonstrations",
    ):
        save_model(tmp_path / "throw.npz", demonstrations, DEFAULT)
    assert not list(tmp_path.iterdir())


def test_demonstrations_keep_their_order_however_many_there_are():
    """Their names have four digits, as far as these go."""
    rows = [{"id": np.array(k)} for k in range(10_003)]
    assert [int(row["id"]) for row in archive.in_order(archive.numbered(rows))] == list(
        range(10_003)
    )
