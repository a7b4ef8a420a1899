"""Checks of arguments and of the rows of arrays, with errors that name what is wrong."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dqslam._limits import LARGEST_VARIANCE, SMALLEST_VARIANCE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def require(value: object, kind: type, call: str, hint: str) -> None:
    """Raise a TypeError that names the needed type and how to get it, unless the value has it."""
    if not isinstance(value, kind):
        given, wanted = _with_article(type(value).__name__), _with_article(kind.__name__)
        raise TypeError(f"{call} needs {wanted}, not {given}: {hint}")


def _with_article(name: str) -> str:
    return f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"


def assign(instance: object, **values: object) -> None:
    """Set fields of a frozen dataclass while it is made."""
    for name, value in values.items():
        object.__setattr__(instance, name, value)


def first_row(bad: Bools) -> int | None:
    """Return the first row with a bad entry, or None if there is none; shape (n, ...)."""
    if not bad.any():
        return None
    return int(np.argmax(bad.reshape(len(bad), -1).any(axis=1)))


def reject_rows(name: str, bad: Bools, reason: str, values: ArrayLike | None = None) -> None:
    """Raise a ValueError that names the first bad row; shape of bad (n, ...)."""
    row = first_row(bad)
    if row is None:
        return
    shown = "" if values is None else f": {np.asarray(values)[row].tolist()}"
    raise ValueError(f"{name} row {row}: {reason}{shown}")


def _check_shape(name: str, array: NDArray[np.generic], shape: Sequence[int | None]) -> None:
    fits = array.ndim == len(shape) and all(
        want is None or have == want for have, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("n" if size is None else str(size) for size in shape)
        raise ValueError(f"{name}: expected shape ({wanted}), got {array.shape}")


def as_floats(name: str, values: ArrayLike, shape: Sequence[int | None]) -> Floats:
    """Return a read-only float copy of the given shape (None: any size), all entries finite."""
    array = _as_numbers(name, values)
    if array.size == 0 and None in shape:
        array = array.reshape([0 if size is None else size for size in shape])
    _check_shape(name, array, shape)
    reject_rows(name, ~np.isfinite(array), "not finite", array)
    array.setflags(write=False)
    return array


def as_directions(name: str, values: ArrayLike, count: int) -> Floats:
    """Return read-only vectors whose direction counts, shape (count, e); none are (count, 0).

    Raises
    ------
    ValueError
        For another number of vectors, and for one that is not finite or has no direction.
    """
    given = np.asarray(values)
    if not given.size:
        return np.zeros((count, 0))
    if given.ndim != 2 or len(given) != count:
        raise ValueError(f"{name}: expected shape ({count}, e), got {given.shape}")
    if given.dtype.kind == "f":  # a long row is not shown
        reject_rows(name, ~np.isfinite(given), "not finite")
    vectors = as_floats(name, given, [count, None])
    reject_rows(name, (vectors == 0).all(axis=1, keepdims=True), "all zero: it has no direction")
    return vectors


def _as_numbers(name: str, values: ArrayLike) -> Floats:
    """Return a float copy; complex numbers have no order and are refused."""
    try:
        given = np.asarray(values)
        numbers = None if given.dtype.kind == "c" else np.array(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: not an array of numbers ({error})") from None
    if numbers is None:
        rows = np.atleast_1d(given)
        reject_rows(name, np.full(rows.shape, True), "complex, not real", rows)
        raise ValueError(f"{name}: complex, not real")  # it has no row
    return numbers


def _beyond_int64(given: NDArray[Any]) -> Bools:
    """Whether numbers would wrap, or are floats so large that neighbors are the same."""
    if given.dtype.kind == "f":
        return np.asarray(np.abs(given) >= 2.0**53)
    if given.dtype.kind == "u":
        return np.asarray(given > np.iinfo(np.int64).max)
    return np.zeros(given.shape, dtype=np.bool_)


def reject_large(name: str, values: Floats, largest: float, unit: str) -> None:
    """Raise a ValueError that names the first row with a number beyond a limit."""
    reject_rows(name, np.abs(values) > largest, f"beyond {largest:g} {unit}", values)


def as_ints(name: str, values: ArrayLike, size: int | None = None) -> Ints:
    """Return a read-only integer copy, shape (size,); floats are refused unless whole."""
    given = np.atleast_1d(np.asarray(values))
    if given.size and given.dtype.kind not in "iu":
        if given.dtype.kind != "f":
            raise ValueError(f"{name}: not an array of whole numbers")
        reject_rows(name, ~(given == np.round(given)), "not a whole number", given)
    reject_rows(name, _beyond_int64(given), "too large for 64 bits", given)
    array = given.astype(np.int64)
    _check_shape(name, array, [size])
    array.setflags(write=False)
    return array


def as_covariances(name: str, values: ArrayLike, count: int, size: int) -> Floats:
    """Return read-only covariances, shape (count, size, size), symmetric positive definite."""
    array = as_floats(name, values, [None, size, size])
    _check_shape(name, array, [count, size, size])
    asymmetric = np.abs(array - array.transpose(0, 2, 1)) > 1e-9 * np.abs(array).max(initial=1e-300)
    reject_rows(name, asymmetric, "covariance is not symmetric")
    variance = np.diagonal(array, axis1=1, axis2=2)
    reject_rows(name, variance <= 0.0, "covariance is not positive definite")
    reject_rows(
        name,
        (variance < SMALLEST_VARIANCE) | (variance > LARGEST_VARIANCE),
        f"variance not between {SMALLEST_VARIANCE:g} and {LARGEST_VARIANCE:g}",
        variance,
    )
    # Of correlations, so that units do not matter.
    scale = 1.0 / np.sqrt(variance)
    correlation = scale[:, :, None] * array * scale[:, None, :]
    smallest = np.linalg.eigvalsh(correlation)[:, :1] if count else np.zeros((0, 1))
    reject_rows(name, smallest <= 0.0, "covariance is not positive definite")
    return array
