"""A first level of the odometry's noise, and the scale of the scene, before there is a map.

Three successive views of a tracklet have a residual of their own: by how much the rays through the
middles of its boxes, with dead reckoning between them, miss the point nearest to them. Noise of the
boxes is in it as well, so that the level is high rather than low.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.association.noise import OF_MOTION, StepNoise
from dqslam.association.rays import cameras_by_odometry, cast_rays
from dqslam.assumptions import OdometryNoise
from dqslam.recording import Recording

# Rays of three views say nothing of a distance below this angle between the outer ones [rad].
MIN_PARALLAX = 0.02
# Nor does the median of fewer residuals of the level.
MIN_TRIPLES = 10
# Residuals below the level, which is to be high: the 95 % of a normal distribution.
HIGH_QUANTILE, HIGH_SIGMAS = 0.95, 1.96
# Rays that miss each other by more a step show nothing that is at rest [rad].
MAX_ANGLE = 0.2
# Share of the length and of the angle of a step that its noise may be, before more is known. Where
# no rays show that anything is at rest, a large one would explain any boxes.
FIRST_SHARE, FIRST_SHARE_UNSEEN = 0.2, 0.005


@dataclass(frozen=True)
class FirstLook:
    """What dead reckoning shows of the boxes of tracklets."""

    angle: float
    """Sigma of a step as it moves the rays, radians."""
    distance: float
    """Median distance of objects, meters."""
    log_size: float
    """Median logarithm of half the size of objects, meters."""


def look(recording: Recording, tracklets: Ints, steps: Ints) -> FirstLook | None:
    """Compare the rays of tracklets (m,); ``steps`` counts those before each pose, shape (n,).

    None if they tell nothing: too few have parallax, or they do not meet.
    """
    rays = cast_rays(recording, cameras_by_odometry(recording))
    pose = recording.detections.pose
    order = np.lexsort((pose, tracklets))
    triple = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)
    same = (tracklets[triple] == tracklets[triple[:, :1]]).all(axis=1)
    triple = triple[same & (np.diff(pose[triple], axis=1) > 0).all(axis=1)]
    direction, origin = rays.direction[triple], rays.origin[triple]  # (n, 3, 3)
    cosine = np.sum(direction[:, 0] * direction[:, 2], axis=1)
    wide = cosine < np.cos(MIN_PARALLAX)
    triple, direction, origin = triple[wide], direction[wide], origin[wide]
    if len(triple) < MIN_TRIPLES:
        return None
    across = np.eye(3) - direction[..., :, None] * direction[..., None, :]
    target = np.einsum("nvij,nvj->ni", across, origin)
    point = np.linalg.solve(across.sum(axis=1), target[..., None])[..., 0]
    towards = point[:, None] - origin
    distance = np.linalg.norm(towards, axis=2)
    ahead = (np.sum(towards * direction, axis=2) > 0).all(axis=1)
    if ahead.sum() < MIN_TRIPLES:
        return None
    sine = np.linalg.norm(np.cross(towards, direction), axis=2) / distance
    # Residuals (1, -2, 1) / 6 of a second difference: that of two steps.
    between = steps[pose[triple[:, 2]]] - steps[pose[triple[:, 0]]]
    sigma = np.sqrt(6.0 * np.sum(sine**2, axis=1) / between)[ahead]
    angle = float(np.quantile(sigma, HIGH_QUANTILE)) / HIGH_SIGMAS
    if angle > MAX_ANGLE:
        return None
    middle = np.median(distance[ahead], axis=1)
    return FirstLook(
        angle,
        float(np.median(middle)),
        float(np.median(np.log(middle * rays.half_width[triple[ahead, 1]]))),
    )


def first_levels(noise: StepNoise, seen: FirstLook | None) -> Floats:
    """Return the levels (c,) to begin with: all that was seen is each axis' own."""
    default = OdometryNoise()
    sigma = (
        (default.translation_m, default.rotation_rad)
        if seen is None
        else (seen.angle * seen.distance, seen.angle)
    )
    levels = np.where(noise.is_rotation, sigma[1], sigma[0])
    share = FIRST_SHARE_UNSEEN if seen is None else FIRST_SHARE
    return np.where(np.isin(noise.names, OF_MOTION), share, levels)
