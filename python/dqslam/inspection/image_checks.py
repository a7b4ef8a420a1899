"""Whether boxes are in pixels of the camera's image, or of an image of another size."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.inspection.comparison import (
    FEWEST_WINDOWS,
    SURE,
    Explanation,
    WindowViews,
    alike,
    clearly_better,
    difference,
)
from dqslam.inspection.evidence import Evidence, Finding, NotEnoughDataError
from dqslam.inspection.pose_checks import GOOD, NOISE, best_readings
from dqslam.inspection.pose_readings import usual_readings
from dqslam.inspection.tracks import LEAST_SCORE
from dqslam.io.readings import BoxReading

Floats = NDArray[np.float64]

# The share of impossible boxes that makes a mistake, and the part of it that may remain.
IMPOSSIBLE_SHARE, LEFT_SHARE = 0.05, 0.03
# Fewer boxes that leave the image are a mistake if another image has room for them.
LEAVING_SHARE, ROOM_SHARE = 0.015, 0.2
# The distance by which trackers predict boxes beyond the image [share of the image].
BEYOND = 0.02
# The least focal length, as a share of the image's side. With an equidistant lens, the image would
# show 25 radians; without distortion, 171 degrees.
SHORTEST_FOCAL = 0.04
# The largest distance of a principal point from the middle of the image [share of the image].
OFF_MIDDLE = 0.15
# Boxes that end together but begin at different places: the least number of beginnings, the least
# share of all boxes, and the end below which they are not at the border [share of the image].
FEWEST_PILED, PILED_SHARE, WITHIN = 5, 0.01, 0.9
ALIKE_PX = 5.0
# Another image must leave this share of the angle by which rays miss, beside the share of motion:
# the one alone favors larger images, the other one smaller ones.
LESS_ANGLE = 0.85
# Sizes of images that boxes may be of: shares, percent, per mille; scales of the camera's image;
# and squares that detectors take: filled, with bars, with bars to the next multiple of a stride
# only, or with the image at their left and top.
SHARES = ((1.0, 1.0), (100.0, 100.0), (1000.0, 1000.0))
SCALES = (0.25, 1 / 3, 0.5, 2 / 3, 0.75, 0.8, 1.25, 4 / 3, 1.5, 2.0, 3.0, 4.0)
SQUARES = (320, 416, 512, 608, 640, 800, 960, 1024, 1280)
STRIDE = 32
MOST_NAMED = 2


@dataclass(frozen=True)
class FittingImage:
    """An image that boxes may be of."""

    reading: BoxReading
    impossible: float  #: share of the boxes that would leave it
    given: WindowViews | None  #: the views of boxes as they are
    explanation: Explanation | None  #: of boxes that are of this image


def check_image_size(evidence: Evidence) -> Finding | None:
    """Check whether boxes are of an image of another size, scaled or with bars.

    Boxes of a larger image leave this one. Boxes of a smaller image pile up at its border, within
    this one. The principal point for another size is far from the middle. Rays meet better if boxes
    are of the right image. A focal length in millimeters is far shorter than any lens has.
    """
    camera, box = evidence.camera, _scored(evidence)
    size = np.array([camera.width, camera.height])
    image = f"the image of {camera.width} x {camera.height} px"
    off = np.abs((np.array([camera.cx, camera.cy]) + 0.5) / size - 0.5)
    beyond = float(np.mean(np.any(box[:, 2:] > size * (1 + BEYOND), axis=1)))
    border = border_within(evidence)
    why = None
    focal = np.array([camera.fx, camera.fy])
    if np.any(focal < SHORTEST_FOCAL * size):
        return Finding(
            "image size",
            f"the focal length of {camera.fx:.3g}, {camera.fy:.3g} px is too short for {image}: is "
            "it in millimeters, or a share of the image? fx, fy of the camera file are in pixels",
        )
    if np.all((box >= -0.05) & (box <= 1.05)):
        return Finding(
            "image size",
            "all boxes are within one pixel: they look like shares of the image (--box-image 1x1)",
        )
    if beyond >= IMPOSSIBLE_SHARE and impossible_shape(box) < IMPOSSIBLE_SHARE:
        reach = np.quantile(box[:, 2:], 0.99, axis=0) + 0.5
        why = f"{beyond:.0%} of the boxes leave {image}: they go to {reach[0]:.0f}, {reach[1]:.0f}"
    elif off.max() > OFF_MIDDLE:
        why = (
            f"the principal point {camera.cx:g}, {camera.cy:g} is far from the middle of {image}: "
            "is it that of another size?"
        )
    elif border is not None:
        why = f"{border}, but {image} does not"
    images = fitting_images(evidence, beyond)
    if why is None and (not images or (beyond < LEAVING_SHARE and _poses_are_it(images[0]))):
        return None
    if not images:
        return Finding("image size", f"{why}; --box-image gives the size of the image of boxes")
    named = " or ".join(_named(one.reading) for one in images[:MOST_NAMED])
    if why is None:
        why = (
            f"{beyond:.1%} of the boxes leave {image}"
            if beyond >= LEAVING_SHARE
            else f"rays to an object meet far better if boxes are not of {image}"
        )
    scaled = any(not one.reading.letterbox for one in images)
    other = "; or fx fy cx cy are of an image of another size" if scaled else ""
    return Finding("image size", f"{why}; they look like those of {named}{other}")


def _poses_are_it(image: FittingImage) -> bool:
    """Tell whether another reading of the poses explains boxes better than another image does."""
    if image.given is None or image.explanation is None:
        return False
    poses = best_readings(image.given, image.given.given, usual_readings())
    least = min((float(one.log_share.mean()) for _, one in poses), default=np.inf)
    return least < float(image.explanation.log_share.mean())


def _named(reading: BoxReading) -> str:
    assert reading.image is not None
    width, height = (f"{side:g}" for side in reading.image)
    bars = " with bars" if reading.letterbox else ""
    option = " --letterbox" if reading.letterbox else ""
    return f"an image of {width} x {height}{bars} (--box-image {width}x{height}{option})"


def fitting_images(evidence: Evidence, beyond: float) -> list[FittingImage]:
    """Return images that boxes are of, more likely than of the camera's; the best one first."""
    camera = evidence.camera
    try:
        views: WindowViews | None = longer(evidence.windows())
    except NotEnoughDataError:
        views = None
    given = None if views is None else views.given
    noise = (
        given is None
        or views is None
        or (given.unexplained <= GOOD and not given.persistence > NOISE)
    )
    if noise and beyond < LEAVING_SHARE and border_within(evidence) is None:
        return []  # nothing speaks against this image
    found = []
    for reading in _images(camera):
        box = reading.boxes(evidence.table, (camera.width, camera.height))
        impossible = impossible_share(camera, box[_sure(evidence)])
        if impossible > LEFT_SHARE:
            continue
        moved = None if views is None else replace(views, middle=middle_of(box)[views.windows.rows])
        found.append(
            FittingImage(reading, impossible, views, None if moved is None else moved.given)
        )
    better = [one for one in found if _explains_better(given, one)]
    if not better and beyond >= LEAVING_SHARE:
        better = [
            one
            for one in found
            if one.impossible <= ROOM_SHARE * beyond and _reaches(evidence, one.reading)
        ]
        if given is not None:
            better = [one for one in better if one.explanation and alike(given, one.explanation)]
    return _simplest(sorted(better, key=_badness), camera)


def _simplest(images: list[FittingImage], camera: _core.Camera) -> list[FittingImage]:
    """Leave out stretched images if one with the proportions of the camera's fits as well."""
    proportions = camera.width / camera.height
    plain = [
        one
        for one in images
        if one.reading.letterbox
        or (
            one.reading.image
            and abs(np.log(one.reading.image[0] / one.reading.image[1] / proportions)) < 0.02
        )
    ]
    if not plain:
        return images
    best, first = images[0].explanation, plain[0].explanation
    return images if best is None or first is None or not alike(best, first) else plain


def _explains_better(given: Explanation | None, image: FittingImage) -> bool:
    """Tell whether rays meet clearly better, if that is known."""
    other = image.explanation
    return given is not None and other is not None and clearly_better_rays(given, other)


def clearly_better_rays(given: Explanation, other: Explanation) -> bool:
    """Tell whether rays meet clearly better, in angle and as a share of the boxes' motion."""
    if not clearly_better(given, other):
        return False
    change, sigmas = difference(given.windows, np.log(given.miss), np.log(other.miss))
    return change <= np.log(LESS_ANGLE) and sigmas <= -SURE


def _badness(image: FittingImage) -> float:
    """Rank images by how well rays meet; those alike by how simple they are."""
    if image.explanation is None:
        return image.impossible
    return round(left_over(image.explanation), 1) + image.impossible


def left_over(explanation: Explanation) -> float:
    """Return the mean logarithm of angle and share of motion that are left."""
    return float(np.mean(np.log(explanation.miss)) + explanation.log_share.mean())


def _images(camera: _core.Camera) -> Iterable[BoxReading]:
    """Return images that boxes may be of, each once, and not that of the camera."""
    size = np.array([camera.width, camera.height], dtype=float)
    images = list(SHARES)
    letterboxes: list[tuple[float, float]] = []
    for scale in SCALES:
        images.append(_rounded(scale * size))
    for side in dict.fromkeys((max(camera.width, camera.height), *SQUARES)):
        within = side / size.max() * size
        letterboxes += [(side, side), _rounded(np.ceil(within / STRIDE) * STRIDE)]
        images += [(side, side), _rounded(within)]
    known = (camera.width, camera.height)
    yield from (BoxReading(image=one) for one in dict.fromkeys(images) if one != known)
    yield from (
        BoxReading(image=one, letterbox=True) for one in dict.fromkeys(letterboxes) if one != known
    )


def _rounded(size: Floats) -> tuple[float, float]:
    width, height = np.round(size).tolist()
    return width, height


def _reaches(evidence: Evidence, reading: BoxReading) -> bool:
    """Tell whether boxes reach the end of an image, across or down."""
    camera = evidence.camera
    size = np.array([camera.width, camera.height])
    box = reading.boxes(evidence.table, (camera.width, camera.height))[_sure(evidence)]
    return bool(np.any(np.quantile(box[:, 2:], 0.99, axis=0) >= WITHIN * size))


def longer(views: WindowViews) -> WindowViews:
    """Leave out short windows, in which another focal length looks like another rotation."""
    long = views.windows.length > 0
    if np.sum(long) < 2 * FEWEST_WINDOWS:
        return views
    windows = views.windows
    kept = replace(
        windows,
        rows=windows.rows[long],
        there=windows.there[long],
        length=windows.length[long],
        part=windows.part[long],
    )
    return replace(views, windows=kept, poses=views.poses[long], middle=views.middle[long])


def border_within(evidence: Evidence) -> str | None:
    """Return where boxes pile up well within the image, or None if they do not."""
    camera, box = evidence.camera, evidence.table.box
    for axis, size in enumerate((camera.width, camera.height)):
        end = float(box[:, 2 + axis].max())
        at_end = box[box[:, 2 + axis] > end - 1]
        # Boxes of an object that stands still end together as well, but boxes at a border begin at
        # different places.
        starts = len(np.unique(np.round(at_end[:, axis] / ALIKE_PX)))
        piled = starts >= FEWEST_PILED and len(at_end) >= PILED_SHARE * len(box)
        if piled and end < WITHIN * size:
            return f"{len(at_end)} boxes end at {'xy'[axis]} = {end:g}, as at a border"
    return None


def _sure(evidence: Evidence) -> NDArray[np.bool_]:
    score = evidence.table.score
    return np.asarray(score >= min(LEAST_SCORE, float(np.median(score))))


def _scored(evidence: Evidence) -> Floats:
    return evidence.table.box[_sure(evidence)]


def middle_of(box: Floats) -> Floats:
    """Return the middles (m, 2) of boxes (m, 4)."""
    return (box[:, :2] + box[:, 2:]) / 2


def impossible_shape(box: Floats) -> float:
    """Return the share of boxes that are inverted or empty."""
    return float(np.mean(np.any(box[:, 2:] <= box[:, :2], axis=1)))


def impossible_share(camera: _core.Camera, box: Floats) -> float:
    """Return the share of boxes that are inverted, or reach far out of the image."""
    size = np.array([camera.width, camera.height])
    bad = (box[:, 2:] <= box[:, :2]) | (box[:, 2:] > size * (1 + BEYOND))
    bad |= box[:, :2] < -BEYOND * size
    return float(np.mean(bad.any(axis=1)))
