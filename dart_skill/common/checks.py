"""Validation: bad input becomes a ValueError that names the value, the place and the remedy."""

from __future__ import annotations

import operator
import sys
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

LARGEST_LEARNABLE = 1e145
"""Size of samples up to which, and of scales down to whose reciprocal, a variance neither overflows
nor loses digits.
"""
FARTHEST = 1000.0
"""Distance from the arm beyond which no hand, ball or basket is: a place that is farther is given in
another unit, or is an error [m].
"""


def unmasked(value: Any) -> Any:
    """What was given; as floats, with nan in their places, where parts are masked or pandas has no
    values: neither passes for a number.

    Parameters
    ----------
    value
        Array, nested lists, Series or DataFrame.

    Raises
    ------
    TypeError, ValueError
        For what is masked or missing, but not numeric.
    """
    if type(value) is np.ndarray:
        return value
    if _has_mask(value):
        return np.ma.filled(np.ma.array(value, dtype=float), np.nan)
    kinds = getattr(value, "dtypes", None)
    if kinds is None or all(
        isinstance(kind, np.dtype) for kind in (kinds if hasattr(kinds, "__iter__") else [kinds])
    ):
        return value
    return value.to_numpy(dtype=float, na_value=np.nan)


def _has_mask(value: Any) -> bool:
    """Whether a value, or an element of a list, is a masked array. Until NumPy's module of these
    is imported, which takes time, none is.
    """
    masked = sys.modules.get("numpy.ma")
    if masked is None:
        return False
    elements = value if isinstance(value, (list, tuple)) else [value]
    return any(isinstance(one, masked.MaskedArray) for one in elements)


def floats(value: Any) -> np.ndarray:
    """An array of floats, which may be `value` itself; nan where it is masked or missing.

    Parameters
    ----------
    value
        As of `unmasked`, and its errors.
    """
    return np.asarray(unmasked(value), dtype=float)


def as_finite(value: ArrayLike, name: str, ndim: int | None = None) -> np.ndarray:
    """A copy of `value` as an array of floats.

    What is masked, or missing in a table of pandas, is not finite.

    Raises
    ------
    ValueError
        If it is not numeric, not finite, or not of `ndim` dimensions.
    """
    try:
        array = np.array(unmasked(value), dtype=float)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be a regular array of numbers: {error}") from None
    if ndim is not None and array.ndim != ndim:
        raise ValueError(
            f"{name} must have {ndim} dimension(s), got shape"
            f" {array.shape}{_reshape_hint(array, ndim)}"
        )
    if not np.isfinite(array).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(
            f"{name} holds {array[place]} at index {place}; remove or interpolate such values"
            " first"
        )
    return array


def _reshape_hint(array: np.ndarray, ndim: int) -> str:
    return "; use reshape(-1, 1) for one dimension" if (array.ndim, ndim) == (1, 2) else ""


def as_samples(value: ArrayLike, name: str, n_dims: int | None = None) -> np.ndarray:
    """Samples (n, d) with n, d >= 1, and d == n_dims where that is given.

    Parameters
    ----------
    value
        What is given.
    name
        Of it, for the message of an error.
    n_dims
        None for any.

    Raises
    ------
    ValueError
        For what is none.
    """
    samples = as_finite(value, name, 2)
    if samples.size == 0:
        raise ValueError(f"{name} is empty, shape {samples.shape}; at least one sample is needed")
    if n_dims is not None and samples.shape[1] != n_dims:
        raise ValueError(f"{name} must have {n_dims} columns, got shape {samples.shape}")
    return samples


def as_learnable(value: ArrayLike, name: str) -> np.ndarray:
    """Samples (n, d) whose squares do not overflow.

    Parameters
    ----------
    value, name
        As of `as_samples`.

    Raises
    ------
    ValueError
        For what is none.
    """
    samples = as_samples(value, name)
    if np.abs(samples).max() > LARGEST_LEARNABLE:
        place = tuple(int(i) for i in np.unravel_index(np.abs(samples).argmax(), samples.shape))
        raise ValueError(
            f"{name} holds {samples[place]:g} at index {place}, too large for a variance; choose a"
            " larger unit"
        )
    return samples


def require_near(
    log_density: np.ndarray, points: np.ndarray, name: str, first_row: int = 0
) -> None:
    """ValueError for the first of the points (n, d) whose log density (n,) is not finite, because
    a square overflowed.

    first_row: row number of points[0] in the array of the caller, for the message.
    """
    finite = np.isfinite(log_density)
    if not finite.all():
        row = int(finite.argmin())
        raise ValueError(
            f"{name} row {first_row + row}, {points[row].tolist()}, is so far away that its log"
            " density overflows"
        )


def as_vector(value: ArrayLike, name: str, length: int | None = None) -> np.ndarray:
    """Vector (length,) of finite numbers.

    Parameters
    ----------
    value, name
        As of `as_samples`.
    length
        None for any.

    Raises
    ------
    ValueError
        For what is none.
    """
    vector = as_finite(value, name, 1)
    if length is not None and len(vector) != length:
        raise ValueError(f"{name} must have length {length}, got {len(vector)}")
    return vector


def as_place(value: ArrayLike, name: str) -> np.ndarray:
    """A place (3,) within `FARTHEST` [m] of the origin in each direction.

    Parameters
    ----------
    value, name
        As of `as_samples`.

    Raises
    ------
    ValueError
        For what is no place.
    """
    place = floats(value)
    # NaN is not within it either
    if place.shape != (3,) or not bool((np.abs(place) <= FARTHEST).all()):
        raise ValueError(
            f"{name} is at {place.tolist()}: give three finite numbers in metres, none beyond"
            f" {FARTHEST:.0f} m"
        )
    return place


def as_weights(value: ArrayLike | None, n_samples: int, name: str = "weights") -> np.ndarray:
    """Weights (n_samples,), not negative and not all zero; ones when None.

    Parameters
    ----------
    value, name
        As of `as_samples`.
    n_samples
        How many.

    Raises
    ------
    ValueError
        For what is none.
    """
    if value is None:
        return np.ones(n_samples)
    weights = as_vector(value, name, n_samples)
    if weights.min() < 0:
        raise ValueError(
            f"{name} must not be negative, got {weights.min()} at index {int(weights.argmin())}"
        )
    if weights.sum() <= 0:
        raise ValueError(f"{name} are all zero; at least one sample must count")
    return weights


def as_count(value: int, name: str, minimum: int = 1) -> int:
    """Integer of at least `minimum`.

    Parameters
    ----------
    value, name
        As of `as_samples`.

    Raises
    ------
    ValueError
        For what is none.
    """
    try:
        count = operator.index(value)
    except TypeError:
        raise ValueError(f"{name} must be an integer, got {value!r}") from None
    if isinstance(value, (bool, np.bool_)) or count < minimum:
        raise ValueError(f"{name} must be an integer of at least {minimum}, got {value!r}")
    return count


def as_number(value: ArrayLike, name: str, minimum: float = 0.0, strict: bool = True) -> float:
    """Finite scalar above `minimum`, or equal to it when not strict.

    Parameters
    ----------
    value, name
        As of `as_samples`.

    Raises
    ------
    ValueError
        For what is none.
    """
    number = float(as_finite(value, name, 0))
    if number < minimum or (strict and number == minimum):
        raise ValueError(
            f"{name} must be {'above' if strict else 'at least'} {minimum:g}, got {number:g}"
        )
    return number


def as_dims(value: ArrayLike, n_dims: int, name: str) -> np.ndarray:
    """Distinct column indices within range(n_dims); an integer stands for one column.

    Parameters
    ----------
    value, name
        As of `as_samples`.
    n_dims
        Number of columns.

    Raises
    ------
    ValueError
        For what is none.
    """
    dims = np.array(value, ndmin=1)
    if _has_mask(value):
        raise ValueError(f"{name} is a masked array: give column indices without a mask")
    if dims.ndim != 1 or dims.size == 0 or dims.dtype.kind not in "iu":
        raise ValueError(f"{name} must be one or more column indices, got {value!r}")
    columns = dims.tolist()
    if min(columns) < 0 or max(columns) >= n_dims or len(set(columns)) != len(columns):
        raise ValueError(f"{name} must be distinct and within 0..{n_dims - 1}, got {columns}")
    return dims


def as_covariances(value: ArrayLike, name: str, shape: tuple[int, ...]) -> np.ndarray:
    """Matrices of the given shape (..., d, d) that are symmetric but for rounding; the rounding is
    removed.

    Parameters
    ----------
    value, name
        As of `as_samples`.

    Raises
    ------
    ValueError
        For what is none.
    """
    matrices = as_finite(value, name)
    if matrices.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, got {matrices.shape}")
    if np.abs(matrices).max(initial=0.0) > LARGEST_LEARNABLE**2:
        raise ValueError(
            f"{name} holds {np.abs(matrices).max():g}, too large for a variance; choose a larger"
            " unit"
        )
    transposed = np.swapaxes(matrices, -1, -2)
    scale = np.sqrt(np.abs(np.diagonal(matrices, axis1=-2, axis2=-1)))
    allowed = 1e-8 * scale[..., :, None] * scale[..., None, :] + np.finfo(float).tiny
    excess = np.abs(matrices - transposed) - allowed
    if (excess > 0).any():
        place = tuple(int(i) for i in np.unravel_index(excess.argmax(), excess.shape))
        raise ValueError(f"{name} must be symmetric, differs from its transpose at {place}")
    return 0.5 * (matrices + transposed)


def check_samples(
    name: str, time: np.ndarray, values: np.ndarray, least: int = 1, width: int = 3
) -> tuple[np.ndarray, np.ndarray]:
    """`time` (n,) and `values` (n, width) as float arrays.

    Parameters
    ----------
    least
        Number of samples n.

    Raises
    ------
    ValueError
        With `name`, for what is no series.
    """
    time, values = floats(time), floats(values)
    if time.ndim != 1 or values.shape != (len(time), width):
        raise ValueError(
            f"{name}: need time (n,) and values (n, {width}), got {time.shape} and {values.shape}"
        )
    if len(time) < least:
        raise ValueError(
            f"{name}: {len(time)} samples, need at least {least}: record longer or look for"
            " occlusion"
        )
    if not (np.isfinite(time).all() and np.isfinite(values).all()):
        index = int(np.argmin(np.isfinite(time) & np.isfinite(values).all(axis=1)))
        raise ValueError(
            f"{name}: sample {index} is not finite: leave out frames in which the body was lost"
        )
    if not (time[1:] > time[:-1]).all():
        index = int(np.argmin(time[1:] > time[:-1]))
        raise ValueError(
            f"{name}: time does not increase after sample {index} ({time[index]} s): sort and drop"
            " repeats"
        )
    return time, values


def check_unit_quaternions(name: str, quaternion: np.ndarray, n_samples: int) -> np.ndarray:
    """Quaternions (n_samples, 4), x, y, z, w, normalised.

    Raises
    ------
    ValueError
        For a norm off by more than 0.001.
    """
    quaternion = floats(quaternion)
    if quaternion.shape != (n_samples, 4):
        raise ValueError(f"{name}: need quaternions ({n_samples}, 4), got {quaternion.shape}")
    norm = np.linalg.norm(quaternion, axis=1, keepdims=True)
    wrong = ~(np.abs(norm[:, 0] - 1.0) <= 1e-3)
    if np.any(wrong):
        index = int(np.argmax(wrong))
        raise ValueError(
            f"{name}: quaternion {index} has norm {norm[index, 0]:.4f}: need norm 1, order x, y,"
            " z, w"
        )
    # What is of unit length already stays as it is, so that data do not change by passing through
    # here again.
    return np.where(np.abs(norm - 1.0) < 1e-12, quaternion, quaternion / norm)


@overload
def to_the_nanosecond(seconds: float) -> float: ...


@overload
def to_the_nanosecond(seconds: np.ndarray) -> np.ndarray: ...


def to_the_nanosecond(seconds: float | np.ndarray) -> float | np.ndarray:
    """Seconds as stamps can say them, so that data are the same before and after they were a
    message; numbers or arrays.
    """
    if isinstance(seconds, np.ndarray):
        return np.round(seconds * 1e9) * 1e-9
    return round(seconds * 1e9) * 1e-9
