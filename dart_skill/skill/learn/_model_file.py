"""A learned skill on disk: the demonstrations that it was made from and its configuration, in one NumPy archive without pickle.

A model is a cache of its demonstrations: loading learns it again, to the last bit. What practice has found out about misses goes with it.
"""

import json
import zipfile
import zlib
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.recording import Demonstration
from dart_skill.robot import KnownRegistration, Registration
from dart_skill.skill.learn._configuration import SkillConfiguration

FORMAT = "dart_skill model 1"
NO_THROWS = np.empty((0, 4))


def save_model(
    path: str | Path, demonstrations: list[Demonstration], configuration: SkillConfiguration, practised: np.ndarray = NO_THROWS
) -> None:
    """Write a model to `path`, which must not exist; the folder must. practised (n, 6): `Correction.throws`."""
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"there is no folder {path.parent} to save a model in")
    content: dict[str, Any] = {"format": np.array(FORMAT), "configuration": np.array(json.dumps(_plain(configuration)))}
    content["practised"] = np.asarray(practised, dtype=float)
    for k, demonstration in enumerate(demonstrations):
        content |= {f"{k:04d}.{f.name}": np.array(getattr(demonstration, f.name)) for f in fields(Demonstration)}
    with open(path, "xb") as file:
        np.savez_compressed(file, **content)


def load_model(path: str | Path) -> tuple[list[Demonstration], SkillConfiguration, np.ndarray]:
    """Demonstrations, configuration, and practised throws (n, 6), in older files (n, 4), of a model file; ValueError if it is not one."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            content = dict(archive)
        if str(content.pop("format")) != FORMAT:
            raise ValueError("unknown format")
        # Models from before there was a choice let go when the teacher did.
        configuration = _configuration({"release": "shown", **json.loads(str(content.pop("configuration")))})
        practised = content.pop("practised", NO_THROWS)
        demonstrations = [_demonstration(content, k) for k in sorted({name.split(".")[0] for name in content})]
    except (KeyError, ValueError, EOFError, TypeError, AttributeError, zipfile.BadZipFile, zlib.error) as error:
        raise ValueError(f"{path} is not a model file of dart_skill: {error}") from error
    return demonstrations, configuration, practised


def _plain(configuration: SkillConfiguration) -> dict[str, Any]:
    """A configuration as JSON has it; without a registration none is named, so that older versions read it."""
    return {name: value for name, value in asdict(configuration).items() if name != "registration" or value is not None}


def _configuration(values: dict[str, Any]) -> SkillConfiguration:
    known = values.pop("registration", None)
    if known is not None:
        known = KnownRegistration(Registration(**known["registration"]), tuple(known["spread"]))
    return SkillConfiguration(**values, registration=known)


def _demonstration(content: dict[str, np.ndarray], key: str) -> Demonstration:
    values = {f.name: content[f"{key}.{f.name}"] for f in fields(Demonstration)}
    kinds = {"id": str, "frame_id": str, "stamp_ns": int}
    plain = {name: kind(values[name]) for name, kind in kinds.items()}
    names = tuple(str(name) for name in values["joint_names"])
    events = {name: float(values[name]) for name in ("motion_start", "motion_stop", "hand_opened")}
    return Demonstration(**{**values, **plain, **events, "joint_names": names})
