"""Hyper-parameters as scikit-learn's users know them: `get_params`, `set_params`,
`sklearn.base.clone`, and a `repr` that shows them.
"""

from __future__ import annotations

import copy
import inspect
from typing import Any, TypeVar

import numpy as np

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
