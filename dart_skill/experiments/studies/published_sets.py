"""Published demonstrations of people, read from the files as their authors published them; the
user names the folder.

* LASA handwriting (Khansari-Zadeh and Billard 2011): seven demonstrations of each of 30 shapes,
  drawn on a tablet [mm], 26 with one pattern and 4 with several. Its licence forbids passing it
  on, so no file of it is in this repository.
* The planar task-parameterised sets of pbdlib-python (Idiap): hand movements in two frames, in
  pixels.
* Letters (HelloWorld) and tasks (RoboTasks, with orientations) that a person showed by leading a
  Panda arm (Auddy et al. 2023).
* Movements of a Panda arm between a pose at its start and one at its end (TP-GMM of Z. Wasfy,
  after that of B. Saduanov).
* Movements of an arm that was led (Figueroa and Billard 2018, as lpvds of S. Sun publishes them),
  and letters drawn by hand (robInfLib of Y. Huang). Neither says under which licence.

`pbdlib_mixture` is of pbdlib-python itself, beside which experiments and benchmarks measure ours.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.checks import as_samples
from dart_skill.movement import TaskFrame, make_continuous

LASA_PAGE = "https://github.com/epfl-lasa/LASAHandwritingDataset"
"""Where LASA handwriting is published."""
PBDLIB_PAGE = "https://gitlab.idiap.ch/rli/pbdlib-python"
"""Where the sets of pbdlib-python are published."""
CLFD_PAGE = "https://github.com/sayantanauddy/clfd"
"""Where letters and tasks of a Panda arm are published."""
TPGMM_PAGE = "https://github.com/zizowasfy/TP-GMM"
"""Where the sets of TP-GMM are published."""
LPVDS_PAGE = "https://github.com/SunannnSun/lpvds"
"""Where movements of an arm that was led are published."""
LETTERS_PAGE = "https://github.com/yanlongtu/robInfLib-matlab"
"""Where letters drawn by hand are published."""
CLFD_RATE = 60.0
"""Samples per second of its sets [1/s], as its own reader has it."""
STEP = 0.01
"""Task-parameterised sets and letters have no stamps in seconds: their samples are taken to be so
far apart [s].
"""


@dataclass(frozen=True, eq=False)
class Demonstrated:
    """One demonstration.

    Parameters
    ----------
    time
        (n,) [s].
    position
        (n, d) in the unit of its set.
    frames
        Of [t, position], empty where the set has none.
    orientation
        (n, 4), unit quaternions x, y, z, w without jumps of sign; None where the set has none.
    """

    time: np.ndarray
    position: np.ndarray
    frames: tuple[TaskFrame, ...] = ()
    orientation: np.ndarray | None = None


def lasa_shapes(folder: Path, *, several: bool = False) -> dict[str, list[Demonstrated]]:
    """The demonstrations of each LASA shape [mm], by name.

    Parameters
    ----------
    folder
        That which holds `DataSet`, or the .mat files themselves.
    several
        The shapes of several patterns instead of those of one.

    Raises
    ------
    ValueError
        There are no such files, or one cannot be read.
    """
    files = sorted((folder / "DataSet" if (folder / "DataSet").is_dir() else folder).glob("*.mat"))
    files = [file for file in files if file.stem.startswith("Multi_Models") == several]
    if not files:
        raise ValueError(
            f"{folder} holds no DataSet/*.mat of LASA handwriting; it is published at {LASA_PAGE}"
        )
    return {file.stem: _read(file, _lasa_shape, LASA_PAGE) for file in files}


def pbdlib_sets(folder: Path) -> dict[str, list[Demonstrated]]:
    """The demonstrations of each planar task-parameterised set [pixels], by name.

    Parameters
    ----------
    folder
        Pbdlib/data, its TPGMM, or what holds pbdlib.

    Raises
    ------
    ValueError
        There are no such files, or one cannot be read.
    """
    below, first = ("pbdlib/data/TPGMM", "data/TPGMM", "TPGMM"), "_tp_0_d_0_A.npy"
    place = _place_of(folder, below, f"*{first}", "of pbdlib/data/TPGMM", PBDLIB_PAGE)
    sets = {}
    for name in sorted(file.name.removesuffix(first) for file in place.glob(f"*{first}")):
        # name0.npy, name1.npy, ... or name_0.npy, ...
        numbers = {
            int(match.group(1)): file
            for file in place.glob(f"{name}*.npy")
            if (match := re.fullmatch(re.escape(name) + r"_?(\d+)", file.stem))
        }
        sets[name] = [
            _read(file, partial(_pbdlib_one, name, number), PBDLIB_PAGE)
            for number, file in sorted(numbers.items())
        ]
    return sets


def helloworld_sets(folder: Path) -> dict[str, list[Demonstrated]]:
    """The demonstrations of each letter [cm], by name.

    Parameters
    ----------
    folder
        Datasets of clfd, or what holds it.

    Raises
    ------
    ValueError
        There are no such files, or one cannot be read.
    """
    return _clfd_sets(folder, "robot_hello_world/processed_demos", 2)


def robotasks_sets(folder: Path) -> dict[str, list[Demonstrated]]:
    """The demonstrations of each task, positions [cm] and orientations, by name.

    Parameters
    ----------
    folder
        Datasets of clfd, or what holds it.

    Raises
    ------
    ValueError
        There are no such files, or one cannot be read.
    """
    return _clfd_sets(folder, "robottasks/pos_ori", 7)


def _clfd_sets(folder: Path, where: str, n_columns: int) -> dict[str, list[Demonstrated]]:
    place = _place_of(
        folder,
        [f"{one}{where}" for one in ("clfd/datasets/", "datasets/", "")],
        "*.npy",
        f"in {where} of clfd",
        CLFD_PAGE,
    )
    if place == folder:  # files of any name are not taken for these
        raise ValueError(f"{folder} holds no {where} of clfd; it is published at {CLFD_PAGE}")
    return {
        file.stem: _read(file, partial(_clfd_one, n_columns), CLFD_PAGE)
        for file in sorted(place.glob("*.npy"))
    }


def tpgmm_sets(folder: Path) -> dict[str, list[Demonstrated]]:
    """The demonstrations of each set of TP-GMM [m], by name.

    All of a set were aligned in time with one of them before they were published, and have its
    stamps. So those with the same stamps are a set. Its name is what the names of its files begin
    with, and how many samples each has.

    Parameters
    ----------
    folder
        Its data, or what holds the repository.

    Raises
    ------
    ValueError
        There are no such files, or one cannot be read.
    """
    place = _place_of(folder, ("TP-GMM/data", "data"), "*_frame1_A.txt", "of TP-GMM", TPGMM_PAGE)
    sets: dict[bytes, dict[str, Demonstrated]] = {}
    for file in sorted(place.glob("*_Data.txt")):
        stamps, one = _read(file, _tpgmm_one, TPGMM_PAGE)
        sets.setdefault(stamps.tobytes(), {})[file.stem] = one
    named: dict[str, list[Demonstrated]] = {}
    for one in sets.values():
        first, shown = next(iter(one)), list(one.values())
        name = f"{os.path.commonprefix(list(one)).rstrip('_')}_{len(shown[0].time)}"
        named[f"{name}_from_{first.removesuffix('_sample_Data')}" if name in named else name] = (
            shown
        )
    return named


def lpvds_sets(folder: Path) -> dict[str, list[Demonstrated]]:
    """The demonstrations of each set of an arm in three dimensions [m], by name.

    Parameters
    ----------
    folder
        Dataset/pc-gmm-data of lpvds, or what holds the repository.

    Raises
    ------
    ValueError
        There are no such files, or one cannot be read.
    """
    below = ("lpvds/dataset/pc-gmm-data", "dataset/pc-gmm-data", "pc-gmm-data")
    place = _place_of(folder, below, "3D*.mat", "of dataset/pc-gmm-data of lpvds", LPVDS_PAGE)
    return {
        file.stem: _read(file, _lpvds_set, LPVDS_PAGE) for file in sorted(place.glob("3D*.mat"))
    }


def letter_sets(folder: Path) -> dict[str, list[Demonstrated]]:
    """The demonstrations of each letter drawn by hand, in the unit of the files, by name.

    Parameters
    ----------
    folder
        2Dletters of robInfLib-matlab, or what holds the repository.

    Raises
    ------
    ValueError
        There are no such files, or one cannot be read.
    """
    below = ("robInfLib-matlab/2Dletters", "2Dletters")
    place = _place_of(folder, below, "[A-Z].mat", "of 2Dletters of robInfLib", LETTERS_PAGE)
    files = sorted(place.glob("[A-Z].mat"))
    return {file.stem: _read(file, _letter, LETTERS_PAGE) for file in files}


def _place_of(folder: Path, below: Sequence[str], files: str, whose: str, page: str) -> Path:
    """The first folder, of those below this one and itself, that has such files; ValueError says
    where they are published.
    """
    place = next(
        (place for place in (*(folder / one for one in below), folder) if any(place.glob(files))),
        None,
    )
    if place is None:
        raise ValueError(f"{folder} holds no {files} {whose}; they are published at {page}")
    return place


def _read(file: Path, reader: Callable[[Path], Any], page: str) -> Any:
    try:
        return reader(file)
    except Exception as error:  # whatever a damaged file makes its reader raise
        raise ValueError(
            f"{file} cannot be read ({type(error).__name__}: {error}); it is published at {page}"
        ) from error


def _lasa_shape(file: Path) -> list[Demonstrated]:
    from scipy.io import loadmat

    demos = loadmat(file, simplify_cells=True)["demos"]
    return [
        Demonstrated(np.ravel(one["t"]).astype(float), as_samples(np.transpose(one["pos"]), "pos"))
        for one in demos
    ]


def _lpvds_set(file: Path) -> list[Demonstrated]:
    """A cell holds positions and velocities (6, n). Where the file does not say how far apart the
    samples are, positions and velocities do: by least squares.
    """
    from scipy.io import loadmat

    content = loadmat(file)
    rows = [as_samples(one, "data").T for one in content["data"].ravel()]
    steps = [np.diff(one[:, :3], axis=0) for one in rows]
    speeds = [one[:-1, 3:] for one in rows]
    across = sum(float(np.sum(a * b)) for a, b in zip(steps, speeds, strict=True))
    told = across / sum(float(np.sum(b * b)) for b in speeds)
    step = float(np.ravel(content["dt"])[0]) if "dt" in content else told
    return [Demonstrated(step * np.arange(len(one)), one[:, :3]) for one in rows]


def _letter(file: Path) -> list[Demonstrated]:
    from scipy.io import loadmat

    shown = [
        as_samples(np.transpose(one["pos"]), "pos")
        for one in loadmat(file, simplify_cells=True)["demos"]
    ]
    return [Demonstrated(STEP * np.arange(len(one)), one) for one in shown]


def _pbdlib_one(name: str, number: int, file: Path) -> Demonstrated:
    """Rows hold the position as seen from each frame, one after the other; frames: matrix A (2, 2)
    and origin b (2,) of each.
    """
    rows = as_samples(np.load(file, allow_pickle=False), "samples")
    frames = []
    for matrix_file in sorted(file.parent.glob(f"{name}_tp_*_d_{number}_A.npy")):
        origin_file = matrix_file.with_name(matrix_file.name.replace("_A.npy", "_b.npy"))
        matrix, offset = np.eye(3), np.load(origin_file, allow_pickle=False)
        matrix[1:, 1:] = np.load(matrix_file, allow_pickle=False)
        frames.append(TaskFrame(matrix, np.concatenate([[0.0], offset])))
    position = rows[:, :2] @ frames[0].A[1:, 1:].T + frames[0].b[1:]
    return Demonstrated(STEP * np.arange(len(rows)), position, tuple(frames))


def _tpgmm_one(file: Path) -> tuple[np.ndarray, Demonstrated]:
    """Stamps (n,) as they are, and one demonstration. A column is a sample: time, x, y, and
    perhaps z. A and b of a frame stand side by side, one for each sample.
    """
    columns = as_samples(np.loadtxt(file, delimiter=","), "samples").T
    n, d = columns.shape
    frames = []
    for matrices_file in sorted(file.parent.glob(file.name.replace("_Data.txt", "_frame*_A.txt"))):
        offsets_file = matrices_file.with_name(matrices_file.name.replace("_A.txt", "_b.txt"))
        matrices = np.loadtxt(matrices_file, delimiter=",").reshape(d, -1, d)
        offsets = np.loadtxt(offsets_file, delimiter=",").reshape(d, -1)
        if (matrices != matrices[:, :1]).any() or (offsets != offsets[:, :1]).any():
            raise ValueError(
                f"{matrices_file.name}: the frame moves, and only frames that stay are known here"
            )
        frames.append(TaskFrame(matrices[:, 0], offsets[:, 0]))
    return columns[:, 0], Demonstrated(STEP * np.arange(n), columns[:, 1:], tuple(frames))


def _clfd_one(n_columns: int, file: Path) -> list[Demonstrated]:
    """Demonstrations (N, n, columns): x, y of letters; x, y, z and a quaternion w, x, y, z of
    tasks.
    """
    every = np.asarray(np.load(file, allow_pickle=False), dtype=float)
    if every.ndim != 3 or every.shape[2] < n_columns:
        raise ValueError(f"demonstrations must have shape (N, n, {n_columns}), got {every.shape}")
    time, found = np.arange(every.shape[1]) / CLFD_RATE, []
    for one in every:
        rows = as_samples(one[:, :n_columns], "samples")
        turned = None if n_columns == 2 else make_continuous(rows[:, [4, 5, 6, 3]])
        found.append(Demonstrated(time, rows[:, :3], orientation=turned))
    return found


def pbdlib_mixture(folder: str | Path) -> Any:
    """The class GMM of a checkout of pbdlib-python, without the plots and Gaussians that load with
    it, which are not used.

    pbdlib-python is no package: folder is its checkout for Python 3, in which pbdlib/gmm.py is.

    Raises
    ------
    ValueError
        It is not there.
    """
    package = Path(folder) / "pbdlib"
    if not (package / "gmm.py").is_file():
        raise ValueError(
            f"there is no pbdlib/gmm.py in {folder}: give the checkout of pbdlib-python"
        )
    stand_ins: dict[str, dict[str, Any]] = {
        "pbdlib": {"__path__": [str(package)]},
        "pbdlib.utils": {"__path__": [str(package / "utils")]},
        "pbdlib.mvn": {"MVN": type("MVN", (), {})},
        "pbdlib.plot": {"plot_gmm": None},
    }
    if "termcolor" not in sys.modules:
        stand_ins["termcolor"] = {"colored": None}
    for name, content in stand_ins.items():
        sys.modules[name] = types.ModuleType(name)
        vars(sys.modules[name]).update(content)
    if (package / "utils" / "gaussian_utils.py").is_file():
        used = importlib.import_module("pbdlib.utils.gaussian_utils").gaussian_moment_matching
        vars(sys.modules["pbdlib.utils"])["gaussian_moment_matching"] = used
    return importlib.import_module("pbdlib.gmm").GMM
