"""Hyper-parameters as scikit-learn's users know them: `get_params`, `set_params`,
`sklearn.base.clone`, and a `repr` that shows them; and models on disk.
"""

from __future__ import annotations

import copy
import inspect
import json
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from dart_skill.common.archive import read_arrays
from dart_skill.common.checks import as_count, as_finite
from dart_skill.common.files import new_file, open_file
from dart_skill.common.words import counted

AnyModel = TypeVar("AnyModel", bound="HyperParameters")


class HyperParameters:
    """Base of what is fitted: the arguments of its constructor are kept as attributes of the same
    names.
    """

    @classmethod
    def _parameters(cls) -> dict[str, inspect.Parameter]:
        """The arguments of the constructor by name, in their order."""
        known = list(inspect.signature(cls.__init__).parameters.values())[1:]
        return {one.name: one for one in known if one.kind is not inspect.Parameter.VAR_KEYWORD}

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The hyper-parameters by name, as the constructor takes them.

        Parameters
        ----------
        deep
            For scikit-learn, which asks with it; nothing here has estimators inside.
        """
        return {name: getattr(self, name) for name in self._parameters()}

    def set_params(self: AnyModel, **params: Any) -> AnyModel:
        """Change hyper-parameters. What was fitted with the former ones is forgotten.

        Parameters
        ----------
        params
            By name, as the constructor takes them.

        Returns
        -------
        AnyModel
            Self.

        Raises
        ------
        ValueError
            Names one that is none.
        """
        known = self.get_params()
        for name in params:
            if name not in known:
                raise ValueError(
                    f"Invalid parameter {name!r} for {type(self).__name__}; it has"
                    f" {', '.join(known)}"
                )
        if params:
            made = type(self)(**{**known, **params})  # or a ValueError, and nothing has changed
            vars(self).clear()
            vars(self).update(vars(made))
        return self

    def __sklearn_clone__(self: AnyModel) -> AnyModel:
        """One with the same hyper-parameters that is not fitted, for `sklearn.base.clone`."""
        return type(self)(**copy.deepcopy(self.get_params()))

    def _fitted_to(self) -> str:
        """What was fitted, in words; empty before."""
        return ""

    def __repr__(self) -> str:
        """The call that makes one, with what is not the default, and what was fitted."""
        defaults = {name: one.default for name, one in self._parameters().items()}
        told = [
            f"{name}={_short(value)}"
            for name, value in self.get_params().items()
            if not _same(value, defaults.get(name))
        ]
        fitted = self._fitted_to()
        return f"{type(self).__name__}({', '.join(told)})" + (f": {fitted}" if fitted else "")


def _same(value: Any, default: Any) -> bool:
    """Whether a value is its default, also where it is an array."""
    return value is default or bool(
        isinstance(value, bool) == isinstance(default, bool) and np.array_equal(value, default)
    )


def _short(value: Any) -> str:
    return repr(value.tolist()) if isinstance(value, np.ndarray) else repr(value)


VERSION = 1
"""Version of the files; it changes when older ones cannot be read as they are any more."""
Arrays = dict[str, np.ndarray]
AnySaved = TypeVar("AnySaved", bound="SavableModel")


class SavableModel(HyperParameters):
    """Base of models with `save` and `load`: hyper-parameters and what was fitted in one NumPy
    archive without pickle, to the last bit. What follows from the rest is computed again.

    A subclass has `_to_arrays` and `_from_arrays`.
    """

    n_demonstrations_: int

    def save(self, path: str | Path) -> None:
        """Write the fitted model to `path`, which must not exist; it is there whole, or not at
        all.

        Raises
        ------
        ValueError
            Before a fit, FileExistsError, or FileNotFoundError if there is no such folder.
        """
        content: dict[str, Any] = dict(self._to_arrays())
        about = json.dumps(
            {
                "parameters": self._plain_params(),
                "n_demonstrations": getattr(self, "n_demonstrations_", 0),
            }
        )
        if not Path(path).parent.is_dir():
            raise FileNotFoundError(f"there is no folder {Path(path).parent} to save a model in")
        with new_file(path) as file:
            np.savez(
                file,
                format=np.array(f"dart_skill {type(self).__name__} {VERSION}"),
                about=np.array(about),
                **content,
            )

    @classmethod
    def load(cls: type[AnySaved], path: str | Path) -> AnySaved:
        """The model that `save` wrote, to the last bit.

        Raises
        ------
        ValueError
            If the file is damaged, of another model or of another version.
        """
        with open_file(path) as file:
            try:
                arrays = read_arrays(file)
                _check_format(str(arrays.pop("format")), cls.__name__)
                about = json.loads(str(arrays.pop("about")))
                model = cls(**cls._from_plain(about["parameters"]))
                model._from_arrays(
                    {name: as_finite(value, name) for name, value in arrays.items()}
                )
                if about["n_demonstrations"]:
                    model.n_demonstrations_ = as_count(
                        about["n_demonstrations"], "n_demonstrations"
                    )
            except Exception as error:  # zip, zlib, JSON and NumPy each have their own for bytes that they do not expect
                missing = (
                    f"it has no {error}"
                    if isinstance(error, KeyError)
                    else str(error) or type(error).__name__
                )
                raise ValueError(
                    f"{path} holds no {cls.__name__} that can be read: {missing}".splitlines()[0]
                ) from error
        return model

    def _to_arrays(self) -> Arrays:
        """What was fitted; ValueError before a fit."""
        raise NotImplementedError

    def _from_arrays(self, arrays: Arrays) -> None:
        """Take over what `_to_arrays` gave; ValueError or KeyError for what does not fit."""
        raise NotImplementedError

    def _plain_params(self) -> dict[str, Any]:
        """The hyper-parameters as JSON has them: numbers come back to the last bit."""
        return {
            name: value.tolist() if isinstance(value, np.ndarray | np.generic) else value
            for name, value in self.get_params().items()
        }

    @classmethod
    def _from_plain(cls, values: dict[str, Any]) -> dict[str, Any]:
        return values

    def _shown(self) -> str:
        """Number of demonstrations, in words."""
        n = getattr(self, "n_demonstrations_", 0)
        return f"{counted(n, 'demonstration')}, " if n else ""


def array_of(arrays: Arrays, name: str, shape: tuple[int | None, ...]) -> np.ndarray:
    """An array of a file.

    Raises
    ------
    ValueError
        Unless it has the shape, in which None stands for any number of at least one.
    """
    found = arrays[name]
    if found.ndim != len(shape) or not all(
        n == m or (m is None and n > 0) for n, m in zip(found.shape, shape, strict=True)
    ):
        raise ValueError(
            f"its {name} have the shape {found.shape}, and not {str(shape).replace('None', 'n')}"
        )
    return found


def _check_format(found: str, kind: str) -> None:
    maker, _, rest = found.partition(" ")
    name, _, version = rest.rpartition(" ")
    if maker != "dart_skill" or not name:
        raise ValueError(f"its format is '{found[:100]}', not 'dart_skill {kind} {VERSION}'")
    if name != kind:
        raise ValueError(f"it holds a {name[:100]}: read it with {name[:100]}.load")
    if version != str(VERSION):
        raise ValueError(
            f"it has version {version[:20]}, and this dart_skill reads version {VERSION}: fit the"
            " model again"
        )
