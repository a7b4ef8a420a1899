"""Read the objects of a map, whatever holds it: a folder of results, ``map.json`` or CSV.

A CSV has one row for each object. Columns are found by name, in any order, and others are ignored:

``class_id`` (or ``class_name``, ``class``)
    The class, any text.
``x y z``
    Center in the frame of the map, meters.
``object_id`` (or ``id``)
    Whole number, optional; by default the row, from 0.
``sx sy sz`` (or ``size_x size_y size_z``)
    Full sizes along the object's own axes, meters, optional.
``cxx cxy cxz cyy cyz czz``
    Covariance of the center, square meters, optional; an empty row is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints, as_covariances
from dqslam._repr import counted
from dqslam.estimate import Estimate
from dqslam.io.csv_table import CsvTable, read_csv
from dqslam.io.files import FileError
from dqslam.io.results import MapObjects, Results, load_map_results, read_map

CLASSES = ("class_id", "class_name", "class")
IDS = ("object_id", "id")
CENTER = ("x", "y", "z")
SIZES = (("sx", "sy", "sz"), ("size_x", "size_y", "size_z"))
COVARIANCE = ("cxx", "cxy", "cxz", "cyy", "cyz", "czz")
# Beyond, sums of squares lose the millimeters that maps are compared by.
LARGEST_M = 1e7

Source = str | Path | Estimate | MapObjects | Results


@dataclass(frozen=True, eq=False)
class Landmarks:
    """The objects of a map, as far as places are recognized by them."""

    name: str
    """The path that it was read from, or what it is."""
    object_ids: Ints
    """Shape (o,)."""
    class_names: tuple[str, ...]
    """One per object."""
    centers: Floats
    """In the frame of the map, meters, shape (o, 3)."""
    covariances: Floats
    """Of the centers, square meters, shape (o, 3, 3); NaN if unknown."""
    semi_axes: Floats
    """Descending, meters, shape (o, 3); NaN if unknown."""
    log_semi_axes_sigmas: Floats
    """Sigmas of the natural logarithms of the semi-axes, shape (o, 3); NaN if unknown."""
    orientations: Floats
    """map_from_object, x y z w, shape (o, 4); NaN if unknown."""
    observations: Ints
    """Number of boxes that showed each object, 0 if unknown, shape (o,)."""
    shares_errors: bool
    """Whether the covariances are of one estimate, whose first pose is exact: the errors of its
    objects then have a part in common, which one row for each object does not show."""
    results: Results | None = None
    """All files of the map, if it was read from a folder of results."""

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.object_ids)

    def __repr__(self) -> str:
        """Show where the map is from, and how many objects and classes it has."""
        classes = len(set(self.class_names))
        return f"Landmarks({self.name!r}, {counted(len(self), 'object')} of {classes} classes)"

    @property
    def has_covariance(self) -> Bools:
        """Whether the covariance of each center is known, shape (o,)."""
        return np.asarray(np.isfinite(self.covariances).all(axis=(1, 2)))


def read_landmarks(source: Source) -> Landmarks:
    """Return the objects of a folder of results, a ``map.json``, a CSV or an estimate.

    Raises
    ------
    FileError
        If a file is missing or wrong, or holds no object; the error names it, and its line or row.
    TypeError
        If the source is neither a path nor a map.
    """
    if isinstance(source, Estimate):
        return landmarks_of(source)
    if isinstance(source, MapObjects):
        return _of_objects(source, "map", None)
    if isinstance(source, Results):
        return _of_objects(source.objects, str(source.directory), source)
    if not isinstance(source, str | Path):
        given = type(source).__name__
        raise TypeError(
            f"a map is a folder of results, a map.json, a CSV, an Estimate, MapObjects or Results, "
            f"not {given}"
        )
    path = Path(source)
    if path.is_dir():
        results = load_map_results(path)
        found = _of_objects(results.objects, str(path), results)
    elif path.suffix.lower() == ".json":
        found = _of_objects(read_map(path), str(path), None)
    else:
        found = _of_csv(path)
    if not len(found):
        raise FileError(path, "holds no object")
    return found


def _of_objects(objects: MapObjects, name: str, results: Results | None) -> Landmarks:
    return Landmarks(
        name=name,
        object_ids=objects.object_ids,
        class_names=objects.class_names,
        centers=objects.centers,
        covariances=objects.center_covariances,
        semi_axes=objects.semi_axes,
        log_semi_axes_sigmas=objects.log_semi_axes_sigmas,
        orientations=objects.orientations,
        observations=objects.observations,
        shares_errors=True,
        results=results,
    )


def landmarks_of(
    estimate: Estimate, objects: Floats | None = None, *, name: str = "estimate"
) -> Landmarks:
    """Return the objects of an estimate, with their covariances (o, 9, 9) as in ``Marginals``."""
    count = len(estimate.object_ids)
    centers, sigmas = np.full((count, 3, 3), np.nan), np.full((count, 3), np.nan)
    if objects is not None:
        known = np.isfinite(objects).all(axis=(1, 2)) & estimate.is_ellipsoid
        for row in np.flatnonzero(known):
            centers[row] = objects[row, :3, :3]
            jacobian = _core.log_semi_axes_jacobian(estimate.ellipsoids[row])
            sigmas[row] = np.sqrt(np.diagonal(jacobian @ objects[row] @ jacobian.T))
    return Landmarks(
        name=name,
        object_ids=estimate.object_ids,
        class_names=estimate.class_names,
        centers=estimate.centers,
        covariances=centers,
        semi_axes=estimate.semi_axes,
        log_semi_axes_sigmas=sigmas,
        orientations=estimate.orientations,
        observations=estimate.observations,
        shares_errors=True,
    )


def _of_csv(path: Path) -> Landmarks:
    table = read_csv(path, required=CENTER)
    classes = next((name for name in CLASSES if name in table), None)
    if classes is None:
        message = f"no column {CLASSES[0]} (it has: {', '.join(table.columns)})"
        raise FileError(path, message, table.header)
    centers = np.column_stack([table.numbers(name) for name in CENTER])
    far = np.asarray((np.abs(centers) > LARGEST_M).any(axis=1))
    table.reject(far, f"the center is beyond {LARGEST_M:g} m")
    ids = next((name for name in IDS if name in table), None)
    object_ids = np.arange(len(table)) if ids is None else table.integers(ids)
    again = np.ones(len(table), dtype=np.bool_)
    again[np.unique(object_ids, return_index=True)[1]] = False
    table.reject(again, "object {} occurs twice", ids)
    return Landmarks(
        name=str(path),
        object_ids=object_ids,
        class_names=table.cells(classes),
        centers=centers,
        covariances=_covariances(table),
        semi_axes=_semi_axes(table),
        log_semi_axes_sigmas=np.full((len(table), 3), np.nan),
        orientations=np.full((len(table), 4), np.nan),
        observations=np.zeros(len(table), dtype=np.int64),
        shares_errors=False,
    )


def _semi_axes(table: CsvTable) -> Floats:
    names = next((names for names in SIZES if all(name in table for name in names)), None)
    semi_axes = np.full((len(table), 3), np.nan)
    if names is None:
        return semi_axes
    known = _filled(table, names)
    size = np.array([[float(table.cells(name)[row]) for name in names] for row in known])
    wrong = np.zeros(len(table), dtype=np.bool_)
    wrong[known] = ~((size > 0.0) & (size < LARGEST_M)).reshape(-1, 3).all(axis=1)
    table.reject(wrong, f"{' '.join(names)}: a size is not positive and below {LARGEST_M:g} m")
    semi_axes[known] = -np.sort(-0.5 * size.reshape(-1, 3), axis=1)
    return semi_axes


def _covariances(table: CsvTable) -> Floats:
    covariances = np.full((len(table), 3, 3), np.nan)
    if not any(name in table for name in COVARIANCE):
        return covariances
    missing = [name for name in COVARIANCE if name not in table]
    if missing:
        raise FileError(table.path, f"no column {', '.join(missing)}", table.header)
    rows, columns = np.triu_indices(3)
    for row in _filled(table, COVARIANCE):
        one = np.zeros((3, 3))
        one[rows, columns] = [float(table.cells(name)[row]) for name in COVARIANCE]
        one = one + np.triu(one, 1).T
        try:
            covariances[row] = as_covariances("covariance", one[None], 1, 3)[0]
        except ValueError as error:
            message = str(error).removeprefix("covariance row 0: ")
            raise FileError(table.path, message, table.lines[row]) from None
    return covariances


def _filled(table: CsvTable, names: tuple[str, ...]) -> list[int]:
    """Return the rows that have numbers in some columns; refuse one that has some of them."""
    cells = np.array([table.cells(name) for name in names]) != ""
    partly = cells.any(axis=0) & ~cells.all(axis=0)
    table.reject(partly, f"some of {' '.join(names)} are empty")
    known = np.flatnonzero(cells.all(axis=0)).tolist()
    for name in names:
        for row in known:
            try:
                value = float(table.cells(name)[row])
            except ValueError:
                value = np.nan
            if not np.isfinite(value):
                message = f"{name} is {table.cells(name)[row]!r}, not a finite number"
                raise FileError(table.path, message, table.lines[row])
    return [int(row) for row in known]
