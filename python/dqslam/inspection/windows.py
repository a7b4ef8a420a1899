"""Windows: some successive views of one object, and how well poses explain where its boxes are.

The middles of an object's boxes move through the image. If the poses are right, a point at rest
explains that motion, but for the noise of boxes and the drift of odometry within the window. The
share that it does not explain has no unit: it compares readings of the same files.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# The motion that ends a window, as a share of the extent of all middles; the last one never ends.
LENGTHS = (0.1, 0.4, np.inf)
LEAST_MOTION = 0.02  #: of a whole track, as a share of that extent
FEWEST_VIEWS, MOST_VIEWS = 4, 8
# The most windows of a length, to save time.
MOST_WINDOWS = 60
# Parts of the time that are taken to be independent.
PARTS = 16
ITERATIONS = 3
# No share counts as less: differences below are noise.
LEAST_SHARE = 0.02
BEHIND = 20.0  #: the miss of a view that has the point behind it, at depth 1
NEAREST = 1e-3  #: the least distance of a point from its cameras, in their spread
FEWEST_STEPS = 40


@dataclass(frozen=True)
class Windows:
    """Views of objects: w windows of at most n views each."""

    rows: Ints  #: (w, n) rows of boxes; a shorter window repeats its last one
    there: NDArray[np.bool_]  #: (w, n) whether it is a view
    length: Ints  #: (w,) which of LENGTHS
    part: Ints  #: (w,) the part of the time

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self.rows)


def find_windows(
    tracks: list[Ints], middle: Floats, time: Floats, *, most: int = MOST_WINDOWS
) -> Windows:
    """Cut tracks into windows of each of LENGTHS, at most ``most`` of each.

    Parameters
    ----------
    tracks
        Rows of the boxes of each object, in order of time.
    middle, time
        Middles (m, 2) and times (m,) of all boxes.
    """
    extent = float(np.linalg.norm(np.diff(np.quantile(middle, [0.05, 0.95], axis=0), axis=0)))
    found: list[Ints] = []
    length: list[int] = []
    for number, share in enumerate(LENGTHS):
        of_length = [part for track in tracks for part in _cut(track, middle, share, extent)]
        if len(of_length) > most:
            chosen = np.linspace(0, len(of_length) - 1, most).round().astype(int)
            of_length = [of_length[i] for i in chosen]
        found += of_length
        length += [number] * len(of_length)
    if not found:
        none = np.zeros((0, MOST_VIEWS), dtype=np.int64)
        return Windows(none, none.astype(bool), none[:, 0], none[:, 0])
    most = max(map(len, found))
    rows = np.array([np.pad(part, (0, most - len(part)), "edge") for part in found])
    there = np.array([np.arange(most) < len(part) for part in found])
    when = np.array([np.median(time[part]) for part in found])
    parts = min(PARTS, max(2, len(found) // 4))
    bounds = np.quantile(when, np.linspace(0, 1, parts + 1)[1:-1])
    return Windows(rows, there, np.array(length), np.searchsorted(bounds, when))


def _cut(track: Ints, middle: Floats, share: float, extent: float) -> list[Ints]:
    """Cut a track where its middles have moved far enough; what is left over is dropped."""
    if not np.isfinite(share):
        moved = float(np.ptp(middle[track], axis=0).max())
        enough = len(track) >= FEWEST_VIEWS and moved > LEAST_MOTION * extent
        return [_thinned(track)] if enough else []
    parts: list[Ints] = []
    place = middle[track]
    start = 0
    while start + FEWEST_VIEWS <= len(track):
        # Most windows are short: look a little further each time.
        end, reach = None, 32
        while end is None:
            moved = np.linalg.norm(place[start : start + reach] - place[start], axis=1)
            moved[: FEWEST_VIEWS - 1] = 0.0
            far = np.flatnonzero(moved >= share * extent)
            if far.size:
                end = start + int(far[0])
            elif start + reach >= len(track):
                return parts
            reach *= 4
        parts.append(_thinned(track[start : end + 1]))
        start = end
    return parts


def _thinned(part: Ints) -> Ints:
    if len(part) <= MOST_VIEWS:
        return part
    kept: Ints = part[np.linspace(0, len(part) - 1, MOST_VIEWS).round().astype(int)]
    return kept


@dataclass(frozen=True)
class Fit:
    """The points at rest that explain windows best, at depth 1; times the focal length in px."""

    miss: Floats  #: (w,) mean distance of middles from their point
    error: Floats  #: (w, n, 2) middles less their point, NaN for views that have it behind them
    depth: Floats  #: (w, n) of the point, in the unit of positions; infinite for a direction


def fit_points(turn: Floats, position: Floats, ray: Floats, there: NDArray[np.bool_]) -> Fit:
    """Find the point at rest that explains each window best.

    The point may be at infinity, so that a camera that only turns is judged, too.

    Parameters
    ----------
    turn, position
        world_from_camera of each view, (w, n, 3, 3) and (w, n, 3).
    ray
        Middles in the plane at depth 1, (w, n, 2).
    there
        Which views count, (w, n).
    """
    count = there.sum(axis=1)
    middle = (position * there[..., None]).sum(axis=1) / count[:, None]
    local = position - middle[:, None]
    size = np.sqrt((np.sum(local**2, axis=2) * there).sum(axis=1) / count)
    local = local / np.maximum(size, 1e-12)[:, None, None]
    # A point X = [x, w] has the camera coordinates R^T (x - w c): rows of u z - x = 0, v z - y = 0.
    across = np.swapaxes(turn[..., :2] - turn[..., 2:] * ray[..., None, :], -1, -2)
    rows = np.concatenate([across, -across @ local[..., None]], axis=-1)
    weight = there.astype(float)
    for _ in range(ITERATIONS):
        point = _nearest(rows, weight, turn, local)
        depth = _depths(point, turn, local)
        ahead = depth > 1e-9
        # The rows at the point are x - u z and y - v z.
        error = -(rows @ point[:, None, :, None])[..., 0]
        error = np.where(ahead[..., None], error / np.where(ahead, depth, 1.0)[..., None], np.nan)
        off = np.linalg.norm(error, axis=2)
        miss = np.where(ahead, np.minimum(off, BEHIND), BEHIND)
        usual = np.median(np.where(there, miss, miss[:, :1]), axis=1)[:, None]
        weight = there / (1 + (miss / (3 * usual + 1e-12)) ** 2) / np.maximum(depth, 1e-3) ** 2
        weight /= weight.max(axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = size[:, None] * depth / point[:, 3:]
    return Fit((miss * there).sum(axis=1) / count, error, far)


def _nearest(rows: Floats, weight: Floats, turn: Floats, local: Floats) -> Floats:
    """Return the homogeneous points [x, w], w >= 0, with the least weighted error: (w, 4)."""
    count, views = weight.shape
    flat = rows.reshape(count, 2 * views, 4)
    normal = np.swapaxes(flat, 1, 2) @ (flat * np.repeat(weight, 2, axis=1)[..., None])
    point = np.linalg.eigh(normal)[1][..., 0]
    depth = _depths(point, turn, local)
    seen = weight > 0
    side = np.where(np.sum(np.sign(depth) * seen, axis=1) < 0, -1.0, 1.0)
    point = point * side[:, None]
    # A point beyond infinity is behind the cameras, and without a baseline any point is at their
    # center: the best direction then takes its place.
    beyond = point[:, 3] < 0
    beyond |= np.linalg.norm(point[:, :3], axis=1) < NEAREST * point[:, 3]
    if beyond.any():
        direction = np.linalg.eigh(normal[beyond][:, :3, :3])[1][..., 0]
        ahead = np.sum(np.einsum("wni,wi->wn", turn[beyond][..., 2], direction), axis=1)
        point[beyond, :3] = direction * np.where(ahead < 0, -1.0, 1.0)[:, None]
        point[beyond, 3] = 0.0
    return point


def _depths(point: Floats, turn: Floats, local: Floats) -> Floats:
    """Return the homogeneous depths of points (w, 4) in views, (w, n)."""
    offset = point[:, None, :3] - point[:, None, 3:] * local
    return np.asarray(np.sum(turn[..., 2] * offset, axis=2))


def persistence(change: Floats, windows: Windows) -> float:
    """Return how much steps (w, n - 1, 2) in windows resemble the step before: -1 to 1, 1 if equal.

    What poses leave unexplained persists from view to view if they are read wrongly, since paths
    are smooth; the noise of odometry is new in every step. NaN with fewer than FEWEST_STEPS. The
    larger value of windows of the two shorter lengths counts.
    """
    known = np.asarray(np.isfinite(change).all(axis=2))
    pairs = windows.there[:, 2:] & known[:, 1:] & known[:, :-1]
    before, after = change[:, :-1], change[:, 1:]
    values = []
    for number in (0, 1):
        chosen = pairs & (windows.length == number)[:, None]
        one, two = before[chosen], after[chosen]
        if len(one) >= FEWEST_STEPS:
            size = np.sum(one**2, axis=1) + np.sum(two**2, axis=1)
            values.append(float(np.mean(2 * np.sum(one * two, axis=1) / np.maximum(size, 1e-24))))
    return max(values, default=float("nan"))


def motions(ray: Floats, there: NDArray[np.bool_]) -> Floats:
    """Return the mean distance of middles from their mean, at depth 1, a window each: (w,)."""
    count = there.sum(axis=1)
    mean = (ray * there[..., None]).sum(axis=1) / count[:, None]
    moved = np.linalg.norm(ray - mean[:, None], axis=2)
    return np.asarray((moved * there).sum(axis=1) / count)


def log_shares(miss: Floats, motion: Floats) -> Floats:
    """Return the logarithm of the share of the motion that is not explained, (w,)."""
    share = miss / np.maximum(motion, 1e-12)
    return np.asarray(0.5 * np.log(np.minimum(share, 100.0) ** 2 + LEAST_SHARE**2))
