"""A camera from named values, under the names that programs use.

What is said twice must agree. A key that may describe a lens, a crop or a scale and is not known is
an error: without it, the camera would be another one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from dqslam import _core
from dqslam.io.camera.build import INTRINSICS, make_camera
from dqslam.io.camera.lenses import (
    COEFFICIENTS,
    IDEAL,
    lens_family,
    lens_of_list,
    lens_of_names,
    plain,
)
from dqslam.io.camera.tables import Table
from dqslam.io.files import FileError
from dqslam.lens import Lens

# Names without punctuation, in lower case: image_width, imageWidth and Image.Width are one.
_NUMBERS: dict[str, tuple[str, ...]] = {
    "fx": ("fx", "flx", "focalx", "focallengthx"),
    "fy": ("fy", "fly", "focaly", "focallengthy"),
    "cx": ("cx", "ppx", "principalx", "principalpointx"),
    "cy": ("cy", "ppy", "principaly", "principalpointy"),
    "width": ("width", "w", "imagewidth", "imgwidth", "resolutionx"),
    "height": ("height", "h", "imageheight", "imgheight", "resolutiony"),
}
_FOCALS = ("f", "focal", "focallength")
_MATRICES = (
    *("k", "m", "mtx", "kmatrix", "cameramatrix", "intrinsicmatrix", "intrinsicsmatrix"),
    *("intrinsics", "intrinsic", "cameraintrinsics", "cameraintrinsic"),
)
_TABLES = ("intrinsics", "intrinsic", "cameraintrinsics", "cameraintrinsic", "camera", "cam")
_SIZES = ("resolution", "imagesize", "imagedimensions")
_LISTS = (
    *("distortion", "distortions", "distk1k2p1p2k3", "dist", "d", "coeffs", "coefs"),
    *("coefficients", "distcoeffs", "distcoefs", "distcoeff", "distcoef", "distcoefficients"),
    *("distortioncoefficients", "distortioncoeffs", "distortioncoefs", "distortionparams"),
    *("distortionparameters", "lensdistortion", "distortionvector", "cameradistortion"),
)
_MODELS = ("distortionmodel", "lensmodel", "cameramodel", "projectionmodel", "distortiontype")
# These may name a device or the type of a sensor instead.
_MAYBE_MODELS = ("model", "type", "cameratype", "lens")
_FISHEYE_FLAGS = ("isfisheye", "fisheye", "fisheyemodel")
_RECTIFIED_FLAGS = ("rectified", "undistorted", "isrectified", "isundistorted")
# Such names, if their values are not zero, change the pixels of a camera.
_SUSPICIOUS = re.compile(
    r"^[kps]\d+$|^tau[xy]$|^(xi|skew|alpha|beta|gamma|kappa\d*|kc|omega)$|^roi|crop"
    r"|dist(?!ance)|coef|lens|radial|tangential|fisheye|prism|rectif|binning|scalefactor"
)
Transform = Callable[[dict[str, float]], dict[str, float]]


def camera_of_names(
    table: Table,
    *,
    harmless: Sequence[str] = (),
    transform: Transform = lambda values: values,
) -> _core.Camera:
    """Return the camera of named values.

    ``harmless`` are keys of the format that are no part of the camera. ``transform`` changes the
    intrinsics by name before they are checked.
    """
    table = _unfolded(table)
    spelt = {plain(str(key)): str(key) for key in table.values}
    used: set[str] = set()
    values, keys = _intrinsics(table, spelt, used)
    missing = [key for key in INTRINSICS if key not in values]
    if missing:
        known = ", ".join(map(str, table.values))
        raise FileError(table.path, f"missing {', '.join(missing)} (it has: {known})")
    lens = _lens(table, spelt, used)
    _refuse_unknown(table, used | set(harmless))
    return make_camera(
        table.path, transform(values), lens, lambda key: table.line_of(keys.get(key, key))
    )


def _unfolded(table: Table) -> Table:
    """Return a table with the values of the tables of intrinsics or of a camera that are in it."""
    values: dict[str, Any] = {}
    for key, value in table.values.items():
        inner = {key: value}
        if plain(str(key)) in _TABLES and isinstance(value, Mapping) and "data" not in value:
            inner = dict(_unfolded(table.part(value)).values)
        for name, one in inner.items():
            if name in values and values[name] != one:
                raise table.error(f"{name} is given twice, as {values[name]} and {one}", str(name))
            values[name] = one
    return table.part(values)


def _intrinsics(
    table: Table, spelt: Mapping[str, str], used: set[str]
) -> tuple[dict[str, float], dict[str, str]]:
    """Return the intrinsics that are given, by name, and the keys that gave them."""
    values: dict[str, float] = {}
    keys: dict[str, str] = {}

    def take(found: Mapping[str, float], key: str) -> None:
        used.add(key)
        for name, value in found.items():
            if values.setdefault(name, value) != value:
                message = f"{name} is {values[name]:g} by {keys[name]}, but {value:g} by {key}"
                raise table.error(message, key)
            keys.setdefault(name, key)

    for name, names in _NUMBERS.items():
        for key in _keys(spelt, names):
            take({name: table.number(key)}, key)
    for key in _keys(spelt, _FOCALS):
        given = table.values[key]
        if isinstance(given, list):
            take(dict(zip(("fx", "fy"), table.numbers(key), strict=False)), key)
        else:
            take({"fx": table.number(key), "fy": table.number(key)}, key)
    for key in _keys(spelt, _SIZES):
        size = table.numbers(key)
        if len(size) != 2:
            raise table.error(f"{key} is not width and height", key)
        take(dict(zip(("width", "height"), size, strict=True)), key)
    for key in _keys(spelt, _MATRICES):
        if not isinstance(table.values[key], str | int | float | bool):
            take(_of_matrix(table, key), key)
    return values, keys


def _of_matrix(table: Table, key: str) -> dict[str, float]:
    """Return fx fy cx cy of a list of these, or of a matrix, by rows or by columns."""
    cells = table.numbers(key)
    if len(cells) == 4:
        return dict(zip(("fx", "fy", "cx", "cy"), cells, strict=True))
    if len(cells) == 9:
        by_rows = (cells[1], cells[3], *cells[6:]) == (0, 0, 0, 0, 1)
        by_columns = (*cells[1:4], cells[5], cells[8]) == (0, 0, 0, 0, 1)
        if by_rows or by_columns:
            place = (2, 5) if by_rows else (6, 7)
            centers = {"cx": cells[place[0]], "cy": cells[place[1]]}
            return {"fx": cells[0], "fy": cells[4]} | centers
    raise table.error(f"{key} is not fx 0 cx, 0 fy cy, 0 0 1", key)


def _lens(table: Table, spelt: Mapping[str, str], used: set[str]) -> Lens:
    family = _family(table, spelt, used)
    found: dict[str, Lens] = {}
    for key in _keys(spelt, _LISTS):
        used.add(key)
        given = table.values[key]
        try:
            if isinstance(given, Mapping) and "data" not in given:
                found[key] = _named(table.part(given), key, family)
            elif given is not None:
                found[key] = lens_of_list(family or "polynomial", table.numbers(key))
        except FileError:
            raise
        except ValueError as error:
            raise table.error(f"{key}: {error}", key) from None
    named = {
        name: spelt[name] for name in COEFFICIENTS if name in spelt and spelt[name] not in used
    }
    if named:
        used |= set(named.values())
        numbers = {name: table.number(key) for name, key in named.items()}
        first = next(iter(named.values()))
        try:
            found[first] = lens_of_names(family, numbers)
        except ValueError as error:
            raise table.error(str(error), first) from None
    lenses = list(found.values())
    if any(lens != lenses[0] for lens in lenses):
        message = f"distortion is given twice: {', '.join(found)}"
        raise table.error(message, list(found)[1])
    for key in _keys(spelt, _RECTIFIED_FLAGS):
        used.add(key)
        if table.values[key] in (1, "true") and not all(lens.is_ideal for lens in lenses):
            raise table.error(f"{key} is true, but there is a lens: {next(iter(found))}", key)
    if not lenses and family in ("equidistant", "fov", "thin_prism_fisheye"):
        raise table.error(f"the lens model is {family}, but it has no coefficients")
    return lenses[0] if lenses else IDEAL


def _named(table: Table, name: str, family: str | None) -> Lens:
    """Return the lens of a table of coefficients by name, with a model of its own if it has one."""
    spelt = {plain(str(key)): str(key) for key in table.values}
    used: set[str] = set()
    family = _family(table, spelt, used) or family
    lists = _keys(spelt, _LISTS)
    if len(lists) == 1 and len(spelt) == len(used) + 1:
        return lens_of_list(family or "polynomial", table.numbers(lists[0]))
    unknown = [key for one, key in spelt.items() if one not in COEFFICIENTS and key not in used]
    if unknown:
        raise table.error(
            f"{name} knows no {unknown[0]}, only {' '.join(COEFFICIENTS)}", unknown[0]
        )
    given = {one: table.number(key) for one, key in spelt.items() if key not in used}
    return lens_of_names(family, given)


def _family(table: Table, spelt: Mapping[str, str], used: set[str]) -> str | None:
    """Return the family of the lens model that is named, None without a name."""
    families: dict[str, str] = {}
    for key in _keys(spelt, _MODELS + _MAYBE_MODELS):
        word = table.values[key]
        if word in (None, ""):
            used.add(key)
        if not isinstance(word, str) or not word:
            continue
        try:
            family = lens_family(word)
        except ValueError as error:
            raise table.error(f"{key} is {word}: {error}", key) from None
        if family is None and plain(key) in _MODELS:
            raise table.error(f"{key} is {word}, which is not known", key)
        used.add(key)
        if family is not None:
            families[key] = family
    for key in _keys(spelt, _FISHEYE_FLAGS):
        if table.values[key] in (0, 1):  # or false and true
            used.add(key)
            if table.values[key]:
                families[key] = "equidistant"
    # "pinhole" is the projection, and the other name is the lens.
    bending = {key: family for key, family in families.items() if family != "pinhole"}
    if len(set(bending.values())) > 1:
        both = " and ".join(f"{key} {table.values[key]}" for key in bending)
        raise table.error(f"two lens models: {both}", list(bending)[1])
    return next(iter(bending.values()), "pinhole" if families else None)


def _refuse_unknown(table: Table, known: set[str]) -> None:
    for key, value in table.values.items():
        name = plain(str(key))
        if key not in known and _says_something(value) and _SUSPICIOUS.search(name):
            message = f"{key} is not known, but may be a part of the lens or of the image"
            raise table.error(message, str(key))


def _says_something(value: Any) -> bool:
    """Return whether a value is not empty, zero or false."""
    if isinstance(value, Mapping):
        return any(_says_something(one) for one in value.values())
    if isinstance(value, list | tuple):
        return any(_says_something(one) for one in value)
    return bool(value)


def _keys(spelt: Mapping[str, str], names: Sequence[str]) -> list[str]:
    return [spelt[name] for name in names if name in spelt]
