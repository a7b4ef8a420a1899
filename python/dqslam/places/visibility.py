"""What cameras at given poses should see of the objects of a map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats

# Rows of a table that is made at once, at most.
_MOST_ROWS = 500_000
# Nothing smaller hides or is hidden, square pixels: no detector finds it.
_LEAST_AREA_PX = 16.0


@dataclass(frozen=True, eq=False)
class Views:
    """Each object of a map from each pose."""

    box: Floats
    """Predicted box, undistorted pixels, shape (n, o, 4); NaN unless the object is in front."""
    in_image: Floats
    """Share of the box that is inside the image, shape (n, o); 0 behind the camera."""
    covered: Floats
    """Largest share of that part that the box of one nearer object covers, shape (n, o).

    Objects that touch each other, like two estimates of one object, do not hide each other.
    """
    size: Floats
    """Square root of the area of that part, pixels, shape (n, o)."""
    distance: Floats
    """From the camera to the center, meters, shape (n, o)."""


def view_objects(
    camera: _core.Camera, poses: Floats, ellipsoids: Floats, hides: Bools | None = None
) -> Views:
    """Predict the boxes of ellipsoids at poses (n, 7), world_from_camera.

    The ellipsoids are the same for each pose, shape (o, 9), or its own, shape (n, o, 9). The camera
    must have no mount. ``hides`` (o,) are the objects that may hide others, by default all.
    """
    ellipsoids = np.broadcast_to(ellipsoids, (len(poses), *ellipsoids.shape[-2:]))
    n, o = ellipsoids.shape[:2]
    if n > 1 and n * o > _MOST_ROWS:
        halves = (slice(None, n // 2), slice(n // 2, None))
        parts = [view_objects(camera, poses[part], ellipsoids[part], hides) for part in halves]
        names = ("box", "in_image", "covered", "size", "distance")
        return Views(*(np.concatenate([getattr(one, name) for one in parts]) for name in names))
    box, _ = _core.project_to_boxes(
        _core.PoseModel.SE3, camera, np.repeat(poses, o, axis=0), ellipsoids.reshape(-1, 9)
    )
    box = box.reshape(n, o, 4)
    last = np.array([camera.width - 0.5, camera.height - 0.5])
    cut = np.concatenate(
        [np.clip(box[..., :2], -0.5, last), np.clip(box[..., 2:], -0.5, last)], axis=-1
    )
    side = np.nan_to_num(cut[..., 2:] - cut[..., :2])
    area = side.prod(axis=-1)
    whole = (box[..., 2:] - box[..., :2]).prod(axis=-1)
    in_image = np.where(area > 0.0, area / np.where(whole > 0.0, whole, 1.0), 0.0)
    apart = ellipsoids[..., :3] - poses[:, None, :3]
    distance = np.sqrt((apart**2).sum(axis=-1))
    radius = np.linalg.det(_core.ellipsoid_shapes(ellipsoids.reshape(-1, 9))) ** (1.0 / 6.0)
    front = distance + radius.reshape(n, o)
    if hides is not None:
        front = np.where(hides, front, np.inf)
    back = distance - radius.reshape(n, o)
    return Views(box, in_image, _covered(cut, area, front, back), np.sqrt(area), distance)


def _covered(cut: Floats, area: Floats, behind: Floats, before: Floats) -> Floats:
    """Return the largest share of each box that one box of a nearer object covers, (n, o).

    An object is nearer if its far side, ``behind``, is before the near side of the other.
    """
    seen = area > _LEAST_AREA_PX
    most = int(seen.sum(axis=1).max(initial=0))
    if len(cut) > 1 and len(cut) * most**2 > _MOST_ROWS:
        parts = [slice(None, len(cut) // 2), slice(len(cut) // 2, None)]
        return np.concatenate([_covered(cut[p], area[p], behind[p], before[p]) for p in parts])
    row = np.argsort(~seen, axis=1, kind="stable")[:, :most]  # those in the image first
    box = np.take_along_axis(cut, row[:, :, None], axis=1)
    own = np.where(np.take_along_axis(seen, row, axis=1), np.take_along_axis(area, row, 1), 1.0)
    far = np.take_along_axis(behind, row, axis=1)
    near = np.take_along_axis(before, row, axis=1)
    low = np.maximum(box[:, :, None, :2], box[:, None, :, :2])
    high = np.minimum(box[:, :, None, 2:], box[:, None, :, 2:])
    common = np.maximum(high - low, 0.0).prod(axis=-1) / own[:, :, None]
    nearer: Bools = far[:, None, :] < near[:, :, None]
    share = np.where(nearer, np.nan_to_num(common), 0.0).max(axis=2, initial=0.0)
    shares = np.zeros(area.shape)
    np.put_along_axis(shares, row, share, axis=1)
    return np.where(seen, shares, 0.0)
