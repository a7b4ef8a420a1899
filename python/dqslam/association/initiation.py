"""New objects: groups of boxes, from several viewpoints, that one object in space explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.association.rays import Rays, cast_rays
from dqslam.recording import Recording

# An object starts from so many viewpoints: with three, boxes of different things meet by chance ...
MIN_VIEWS = 4
# ... of which two are this far apart [rad]: below, its distance is as good as unknown.
MIN_PARALLAX = 0.08
# Boxes agree with a sphere when their middles lie within this part of their side of its center ...
MAX_CENTER_OFFSET = 0.4
# ... and their sides are those of the sphere within this factor.
MAX_SIDE_FACTOR = 1.5
# So many boxes of one class are compared with each other, the latest ones: all pairs are.
MAX_BOXES_COMPARED = 60


def propose_groups(
    recording: Recording,
    cameras: Floats,
    rows: Ints,
    tracklet: Ints,
    *,
    tracklets_only: bool = False,
) -> list[Ints]:
    """Group waiting boxes: tracklets that are long enough, then boxes that meet in space.

    Parameters
    ----------
    cameras
        world_from_camera of each pose, as estimated so far, shape (n, 7).
    rows
        The boxes that wait.
    tracklet
        Of each box of the recording, shape (m,).
    tracklets_only
        Whether boxes of different tracklets never show the same object.
    """
    waiting = recording.detections.select(rows)
    rays = cast_rays(replace(recording, detections=waiting), cameras)
    number = tracklet[rows]
    groups, rest = [], np.zeros(len(rows), dtype=bool)
    for one in np.unique(number):
        part = np.flatnonzero(number == one)
        if len(np.unique(waiting.pose[part])) < MIN_VIEWS:
            rest[part] = True
        elif parallax(rays, part) >= MIN_PARALLAX:
            groups.append(part)
    rest &= not tracklets_only
    for class_id in np.unique(waiting.class_id[rest]).tolist():
        part = np.flatnonzero(rest & (waiting.class_id == class_id))
        part = part[np.argsort(waiting.pose[part], kind="stable")][-MAX_BOXES_COMPARED:]
        groups += _meeting(rays, waiting.pose, part)
    return [rows[group] for group in groups]


def parallax(rays: Rays, rows: Ints) -> float:
    """Return the largest angle between two of some rays, radians."""
    cosine = rays.direction[rows] @ rays.direction[rows].T
    return float(np.arccos(np.clip(cosine.min(), -1.0, 1.0)))


def _meeting(rays: Rays, pose: Ints, rows: Ints) -> list[Ints]:
    """Group boxes by the spheres that most of them agree with, one box of each pose."""
    groups: list[Ints] = []
    while len(np.unique(pose[rows])) >= MIN_VIEWS:
        group = rows[_largest_group(rays, pose, rows)]
        if len(group) < MIN_VIEWS:
            break
        groups.append(group)
        rows = np.setdiff1d(rows, group)
    return groups


def _largest_group(rays: Rays, pose: Ints, rows: Ints) -> Bools:
    """Let each pair of rays propose a sphere; return which boxes agree with the best of them."""
    center, radius = _spheres(rays, pose, rows)
    if not len(center):
        return np.zeros(len(rows), dtype=bool)
    towards = center[:, None] - rays.origin[rows]
    distance = np.linalg.norm(towards, axis=2)
    sine = np.linalg.norm(np.cross(towards / distance[..., None], rays.direction[rows]), axis=2)
    miss = sine / (2 * rays.half_width[rows]) / MAX_CENTER_OFFSET
    ratio = radius[:, None] / distance / rays.half_width[rows]
    factor = np.abs(np.log(ratio)) / np.log(MAX_SIDE_FACTOR)
    ahead = np.sum(towards * rays.direction[rows], axis=2) > 0
    badness = np.where(ahead & (miss < 1) & (factor < 1), miss + factor, np.inf)
    # One box of each pose, the nearest.
    agrees = np.zeros(badness.shape, dtype=bool)
    spheres = np.arange(len(center))
    for one in np.unique(pose[rows]):
        columns = np.flatnonzero(pose[rows] == one)
        nearest = columns[np.argmin(badness[:, columns], axis=1)]
        agrees[spheres, nearest] = np.isfinite(badness[spheres, nearest])
    score = agrees.sum(axis=1) - 0.1 * np.sum(badness, axis=1, where=agrees)
    return np.asarray(agrees[np.argmax(score)])


def _spheres(rays: Rays, pose: Ints, rows: Ints) -> tuple[Floats, Floats]:
    """Return centers (s, 3) and radii (s,) where two rays from different poses meet in front."""
    i, j = np.triu_indices(len(rows), 1)
    i, j = rows[i], rows[j]
    cosine = np.sum(rays.direction[i] * rays.direction[j], axis=1)
    base = rays.origin[j] - rays.origin[i]
    squared_sine = np.maximum(1.0 - cosine**2, 1e-12)
    along_i = np.sum(base * rays.direction[i], axis=1)
    along_j = np.sum(base * rays.direction[j], axis=1)
    depth_i = (along_i - cosine * along_j) / squared_sine
    depth_j = (cosine * along_i - along_j) / squared_sine
    good = (pose[i] != pose[j]) & (squared_sine > np.sin(MIN_PARALLAX) ** 2)
    good &= (depth_i > 0) & (depth_j > 0)
    i, j, depth_i, depth_j = i[good], j[good], depth_i[good, None], depth_j[good, None]
    on_i = rays.origin[i] + rays.direction[i] * depth_i
    on_j = rays.origin[j] + rays.direction[j] * depth_j
    radius = np.sqrt(depth_i[:, 0] * rays.half_width[i] * depth_j[:, 0] * rays.half_width[j])
    return 0.5 * (on_i + on_j), radius
