"""A learned skill on disk: the demonstrations that it was made from and its configuration, in one
NumPy archive without pickle.

A model is a cache of its demonstrations: loading learns it again, to the last bit. What practice
has found out about misses goes with it.
"""

import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dart_skill.arm import KnownRegistration, Registration
from dart_skill.common.archive import in_order, numbered, read_arrays, write_arrays
from dart_skill.common.files import new_file, open_file
from dart_skill.recording import Demonstration
from dart_skill.skills.learning._configuration import SkillConfiguration

KIND, VERSION = "dart_skill model", 2
"""What a model file says it is. The version changes when older files cannot be read as they are
any more.
"""
NO_THROWS = np.empty((0, 6))


class SavedModel(NamedTuple):
    """What is in a model file.

    * demonstrations: list of Demonstration.
    * configuration: SkillConfiguration.
    * practised: (n, 6), `Correction.throws`.
    * found: dict, what practice has found besides, `PractisingSkill.state`; None before practice.
    * origin: dict, how the recording was read that it was learned from, where that was not plain;
      else None.
    """

    demonstrations: list[Demonstration]
    configuration: SkillConfiguration
    practised: np.ndarray
    found: dict | None
    origin: dict | None = None


def save_model(
    path: str | Path,
    demonstrations: list[Demonstration],
    configuration: SkillConfiguration,
    practised: np.ndarray = NO_THROWS,
    found: dict | None = None,
    origin: dict | None = None,
) -> None:
    """Write a model to `path`, which must not exist; the folder must. It is there whole, or not at
    all.

    practised (n, 6): `Correction.throws`. found: what practice has found besides,
    `PractisingSkill.state`; default None: nothing. origin: as of `SavedModel`; None where stamps
    were taken as they are. FileNotFoundError if there is no such folder, ValueError if the
    demonstrations are more than a model may have.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"there is no folder {path.parent} to save a model in")
    content: dict[str, Any] = {
        "format": np.array(f"{KIND} {VERSION}"),
        "configuration": np.array(json.dumps(asdict(configuration))),
    }
    content["practised"] = np.asarray(practised, dtype=float)
    for name, value in (("found", found), ("origin", origin)):
        if value is not None:
            content[name] = np.array(json.dumps(value, allow_nan=False))
    content |= numbered(
        {field.name: getattr(one, field.name) for field in fields(one)} for one in demonstrations
    )
    with new_file(path) as file:
        write_arrays(file, content)


def load_model(path: str | Path) -> SavedModel:
    """Demonstrations, configuration, and what practice has found, of a model file.

    ValueError if it is not one, or one of another version.
    """
    with open_file(path) as file:
        try:
            content = read_arrays(file)
            _check_format(str(content.pop("format")))
            configuration = _configuration(json.loads(str(content.pop("configuration"))))
            practised = _practised(content.pop("practised"))
            found, origin = _found(content.pop("found", None)), _found(content.pop("origin", None))
            demonstrations = [_demonstration(values) for values in in_order(content)]
        except Exception as error:  # zip, zlib, JSON and NumPy each have their own for bytes that they do not expect
            raise ValueError(
                f"{path} is not a model file of dart_skill: {error or type(error).__name__}"
            ) from error
    return SavedModel(demonstrations, configuration, practised, found, origin)


def _check_format(found: str) -> None:
    kind, _, version = found.rpartition(" ")
    if kind != KIND:
        raise ValueError(f"its format is '{found[:100]}', not '{KIND} {VERSION}'")
    if version != str(VERSION):
        raise ValueError(
            f"it has version {version[:20]}, and this dart_skill reads version {VERSION}: learn"
            " from the bag again"
        )


def _practised(values: np.ndarray) -> np.ndarray:
    values = np.asarray(values)
    if values.ndim != 2 or values.shape[1] != 6 or not np.issubdtype(values.dtype, np.floating):
        raise ValueError(
            f"its practised throws have the shape {values.shape}: (n, 6) numbers are known"
        )
    return values


def _found(text: np.ndarray | None) -> dict | None:
    found = None if text is None else json.loads(str(text))
    if not isinstance(found, (dict, type(None))):
        raise ValueError(
            "what practice found, or where it is from, is no object of JSON but"
            f" {type(found).__name__}"
        )
    return found


def _configuration(values: dict[str, Any]) -> SkillConfiguration:
    known = values.pop("registration")
    if known is not None:
        known = KnownRegistration(Registration(**known["registration"]), tuple(known["spread"]))
    return SkillConfiguration(**values, registration=known)


def _demonstration(content: dict[str, np.ndarray]) -> Demonstration:
    values: dict[str, Any] = {f.name: content[f.name] for f in fields(Demonstration)}
    kinds = {"id": str, "frame_id": str, "stamp_ns": int, "skill": str}
    plain = {name: kind(values[name]) for name, kind in kinds.items()}
    names = tuple(str(name) for name in values["joint_names"])
    events = {name: float(values[name]) for name in ("motion_start", "motion_stop", "hand_opened")}
    return Demonstration(**{**values, **plain, **events, "joint_names": names})
