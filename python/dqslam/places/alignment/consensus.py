"""Whether two maps are of one place, and how they lie to each other."""

from __future__ import annotations

from typing import Literal

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._repr import counted
from dqslam.places.alignment.judge import (
    CHANCE,
    RIVAL,
    Hypothesis,
    doubt,
    judge,
    lead,
    match_again,
)
from dqslam.places.alignment.likelihood import Objects, Target, spacing
from dqslam.places.alignment.refine import Refined, refine
from dqslam.places.alignment.result import Alignment, CannotTellError, Rival
from dqslam.places.alignment.rigid import MotionModel, Motions
from dqslam.places.alignment.search import search
from dqslam.places.landmarks import Landmarks, Source, read_landmarks

MotionName = Literal["auto", "se2", "se3"]
# Centers of unknown uncertainty are assumed to be known to this share of the room of an object.
SIGMA_OF_SPACING = 1.0 / 20.0
# Of the mean logarithm of the semi-axes, if a map does not say so, and at least.
_SIZE_SIGMA, _LEAST_SIZE_SIGMA = 0.2, 0.1
_FEWEST = 3
_GROWTHS = 10
# Upright motions with less evidence are compared with tilted ones, by more than this turn [rad]:
# objects of one height lie in the mirrored order where a map is upside down, and some may agree.
_SURE, _TILTED = 50.0, 0.2


def align(
    a: Source | Landmarks,
    b: Source | Landmarks,
    *,
    motion: MotionName = "auto",
    scale: bool = False,
    sigma: float | None = None,
) -> Alignment:
    """Find the motion that takes a map to another one of the same place.

    Maps are folders of results, ``map.json`` files, CSV files ``class_id,x,y,z`` with optional
    sizes and covariances, or what ``load_results`` and ``solve`` return. Objects of the same class
    are matched by where they are relative to each other; nothing else needs to be known.

    Parameters
    ----------
    motion
        ``se2`` if both maps have z up, else ``se3``. By default, ``se2`` is tried first, and
        ``se3`` if it says little or nothing: the answer with clearly more evidence is taken.
    scale
        Whether the units of length may differ, as of maps from images alone.
    sigma
        Error of a coordinate of a center [m] where a map has no covariances. By default it is
        a twentieth of the side of the square (cube) that an object has for itself. Errors from an
        eighth to four times of that are considered.

    Raises
    ------
    CannotTellError
        If too few objects agree, so many would by chance, or another motion is as good.
    FileError
        If a map is missing or wrong.

    Examples
    --------
    >>> import dqslam as dq
    >>> found = dq.align("first.csv", "second.csv")
    >>> found
    Alignment(se2, 12 pairs, 0.03 m apart)
    """
    a, b = (x if isinstance(x, Landmarks) else read_landmarks(x) for x in (a, b))
    return align_landmarks(a, b, motion=motion, scale=scale, sigma=sigma)[0]


def align_landmarks(
    a: Landmarks,
    b: Landmarks,
    *,
    motion: MotionName = "auto",
    scale: bool = False,
    sigma: float | None = None,
) -> tuple[Alignment, Refined]:
    """Align maps as ``align`` does; return how the motion was fitted, too."""
    if sigma is not None and not (np.isfinite(sigma) and sigma > 0.0):
        raise ValueError(f"sigma is {sigma:g} m, not positive")
    if motion not in ("auto", "se2", "se3"):
        raise ValueError(f"motion is {motion!r}, not auto, se2 or se3")
    common = _common(a, b)
    if motion != "auto":
        return _align(a, b, common, MotionModel(motion == "se2", scale), sigma)
    try:
        upright = _align(a, b, common, MotionModel(True, scale), sigma)
    except _TooFewError as error:
        try:
            return _align(a, b, common, MotionModel(False, scale), sigma)
        except CannotTellError:
            raise CannotTellError(str(error)) from None
    if upright[0].evidence > _SURE:
        return upright
    try:
        free = _align(a, b, common, MotionModel(False, scale), sigma)
    except CannotTellError:
        return upright
    is_tilted = free[0].b_from_a[2, 2] < free[0].scale * np.cos(_TILTED)
    return free if is_tilted and free[0].evidence > upright[0].evidence + RIVAL else upright


class _TooFewError(CannotTellError):
    """No motion has enough evidence: another kind of motion may."""


def _common(a: Landmarks, b: Landmarks) -> tuple[Ints, Ints]:
    """Return the rows of both maps whose class is in both."""
    names = set(a.class_names) & set(b.class_names)
    rows = [
        np.array([row for row, name in enumerate(x.class_names) if name in names], dtype=np.int64)
        for x in (a, b)
    ]
    if not names:
        shown = [", ".join(sorted(set(x.class_names))[:5]) for x in (a, b)]
        raise CannotTellError(f"no class is in both maps: {shown[0]}; {shown[1]}")
    fewest = min(map(len, rows))
    if fewest < _FEWEST:
        name = (a, b)[int(len(rows[1]) == fewest)].name
        raise CannotTellError(
            f"{name} has {counted(fewest, 'object')} of classes that are in both maps, "
            f"{_FEWEST} are needed"
        )
    return rows[0], rows[1]


def _align(
    a: Landmarks,
    b: Landmarks,
    rows: tuple[Ints, Ints],
    model: MotionModel,
    sigma: float | None,
) -> tuple[Alignment, Refined]:
    room = max(spacing(x.centers[r], model.axes) for x, r in zip((a, b), rows, strict=True))
    assumed = SIGMA_OF_SPACING * room if sigma is None else sigma
    labels = {name: number for number, name in enumerate(sorted(set(a.class_names)))}
    objects_a, objects_b = (
        _objects(x, r, labels, assumed, model) for x, r in zip((a, b), rows, strict=True)
    )
    target = Target(objects_b, model, room)
    candidates = search(objects_a, target, model, assumed)
    found = judge(objects_a, target, model, candidates.motions)
    if not found:
        raise _TooFewError("no three objects of one map lie to each other as in the other map")
    why = doubt(found)
    if why:
        raise _refusal(why, found)
    pairs, motion, freedom = found[0].pairs, found[0].motion, None
    for _ in range(_GROWTHS):
        of_maps = np.column_stack([r[pairs[:, i]] for i, r in enumerate(rows)])
        refined = refine(a, b, of_maps, motion, model, assumed, freedom)
        motion, freedom, before = refined.motion, refined.freedom, pairs
        variance = _variance_by_class(objects_a, pairs, refined, model)
        pairs = match_again(objects_a, target, motion, variance, freedom[0])
        if len(pairs) < _FEWEST or np.array_equal(pairs, before):
            break
    return _alignment(a, b, found, of_maps, refined, model, assumed), refined


def _variance_by_class(
    objects: Objects, pairs: Ints, refined: Refined, model: MotionModel
) -> Floats:
    """Return the variance of a coordinate of a pair, by the class of objects of A, (o,)."""
    axes = model.axes
    of_pair = np.trace(refined.pair_covariances[:, :axes, :axes], axis1=1, axis2=2) / axes
    variance = np.full(len(objects), of_pair.mean())
    labels = objects.labels[pairs[:, 0]]
    for label in np.unique(labels):
        variance[objects.labels == label] = of_pair[labels == label].mean()
    return variance


def _refusal(why: str, found: list[Hypothesis]) -> CannotTellError:
    if len(found) < 2 or found[0].evidence < CHANCE:
        return _TooFewError(why)
    first, second = (describe(one.motion) for one in found[:2])
    return CannotTellError(f"{why}: {first}, or {second}")


def describe(motion: Motions) -> str:
    """Describe a motion in words: its turn about z, and where it takes the origin."""
    yaw = np.degrees(np.arctan2(motion.rotation[0, 1, 0], motion.rotation[0, 0, 0]))
    x, y, z = motion.translation[0]
    return f"{yaw:.1f} degrees and ({x:.2f}, {y:.2f}, {z:.2f}) m"


def _objects(
    landmarks: Landmarks, rows: Ints, labels: dict[str, int], sigma: float, model: MotionModel
) -> Objects:
    covariances = landmarks.covariances[rows][:, : model.axes, : model.axes]
    variance = np.trace(covariances, axis1=1, axis2=2) / model.axes
    # The uncertainty of a map is that of its objects to each other at best: drift is more.
    variance = np.fmax(variance, sigma**2)
    log_axes = np.log(landmarks.semi_axes[rows])
    size_sigma = np.sqrt(np.mean(landmarks.log_semi_axes_sigmas[rows] ** 2, axis=1))
    size_sigma = np.where(np.isfinite(size_sigma), size_sigma, _SIZE_SIGMA)
    return Objects(
        centers=landmarks.centers[rows],
        labels=np.array([labels[landmarks.class_names[row]] for row in rows.tolist()]),
        variance=variance,
        size=log_axes.mean(axis=1),
        size_variance=np.maximum(size_sigma, _LEAST_SIZE_SIGMA) ** 2,
    )


def _matrix(motion: Motions) -> Floats:
    matrix = np.eye(4)
    matrix[:3, :3] = motion.scale[0] * motion.rotation[0]
    matrix[:3, 3] = motion.translation[0]
    return matrix


def _alignment(
    a: Landmarks,
    b: Landmarks,
    found: list[Hypothesis],
    pairs: Ints,
    refined: Refined,
    model: MotionModel,
    sigma: float,
) -> Alignment:
    best = found[0]
    rival = found[1] if len(found) > 1 else None
    rows_a, rows_b = pairs.T
    return Alignment(
        b_from_a=_matrix(refined.motion),
        covariance=refined.covariance,
        motion="se2" if model.upright else "se3",
        scale=float(refined.motion.scale[0]),
        scale_sigma=refined.scale_sigma,
        a_ids=a.object_ids[rows_a],
        b_ids=b.object_ids[rows_b],
        class_names=tuple(a.class_names[row] for row in rows_a.tolist()),
        distance=np.linalg.norm(refined.differences, axis=1),
        evidence=best.evidence,
        lead=lead(found),
        runner_up=None
        if rival is None
        else Rival(_matrix(rival.motion), len(rival.pairs), rival.evidence),
        assumptions=tuple(_assumptions(a, b, model, sigma)),
    )


def _assumptions(a: Landmarks, b: Landmarks, model: MotionModel, sigma: float) -> list[str]:
    said = []
    if model.upright:
        said.append("z is up in both maps")
    if not model.has_scale:
        said.append("both maps have the same unit of length")
    unknown = [x.name for x in (a, b) if not x.has_covariance.all()]
    if unknown:
        said.append(
            f"centers without a covariance, in {' and '.join(unknown)}, are known to {sigma:.2g} m "
            "before the pairs show how well"
        )
    shared = [x.name for x in (a, b) if x.shares_errors and x.has_covariance.all()]
    if shared:
        said.append(
            f"what the covariances in {' and '.join(shared)} have in common with one motion of all "
            "objects is an error of the map as a whole"
        )
    return said
