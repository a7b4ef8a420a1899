"""One map from two that are aligned: what both say of an object, weighted by its covariance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.places.alignment.likelihood import tangent
from dqslam.places.alignment.refine import Refined, common_motion
from dqslam.places.alignment.result import Alignment
from dqslam.places.alignment.rigid import MotionModel
from dqslam.places.landmarks import Landmarks

_SPACE = MotionModel(upright=False, has_scale=False)
# Least share of a variance that stays with an object itself, once the motion of all is taken out.
_LEAST_OWN = 1e-3


@dataclass(frozen=True, eq=False)
class Fused:
    """A map in the frame of A, and where its objects are from."""

    landmarks: Landmarks
    row_of_a: Ints
    """Row of the fused map of each object of A, (a,)."""
    row_of_b: Ints
    """Row of the fused map of each object of B, (b,)."""
    covariance: Floats
    """Of the motion that took B into the frame of A, in that frame, (6, 6)."""
    shape_from_b: Ints
    """Rows of the fused map whose size is that of B, although A has the object."""


def fuse(a: Landmarks, b: Landmarks, found: Alignment, refined: Refined) -> Fused:
    """Return both maps as one in the frame of A.

    The errors of a map are taken for a motion of the whole, as far as its covariances have one in
    common, and for errors of each object that are independent. The motion of B is in the alignment,
    that of A stays; of the others, those of both maps and of the alignment are weighed.
    """
    inverse = np.asarray(np.linalg.inv(found.b_from_a), dtype=np.float64)
    inflation = max(1.0, float(np.median(refined.factors)))
    whole, own_a = _parts(a, refined, inflation)
    _, own_b = _parts(b, refined, inflation)
    moved = b.centers @ inverse[:3, :3].T + inverse[:3, 3]
    jacobian = tangent(moved, _SPACE)
    turned = inverse[:3, :3] @ own_b @ inverse[:3, :3].T
    own_b = turned + jacobian @ refined.independent @ jacobian.swapaxes(1, 2)
    pairs_a = np.searchsorted(a.object_ids, found.a_ids, sorter=np.argsort(a.object_ids))
    pairs_a = np.argsort(a.object_ids)[pairs_a]
    order_b = np.argsort(b.object_ids)
    pairs_b = order_b[np.searchsorted(b.object_ids, found.b_ids, sorter=order_b)]
    alone = np.setdiff1d(np.arange(len(b)), pairs_b)
    row_of_b = np.zeros(len(b), dtype=np.int64)
    row_of_b[pairs_b] = pairs_a
    row_of_b[alone] = len(a) + np.arange(len(alone))

    centers, own = a.centers.copy(), own_a.copy()
    gain = own_a[pairs_a] @ np.linalg.inv(own_a[pairs_a] + own_b[pairs_b])
    apart = (moved[pairs_b] - centers[pairs_a])[:, :, None]
    centers[pairs_a] += (gain @ apart)[:, :, 0]
    own[pairs_a] = own_a[pairs_a] - gain @ own_a[pairs_a]
    centers = np.concatenate([centers, moved[alone]])
    jacobian = tangent(centers, _SPACE)
    full = np.concatenate([own, own_b[alone]]) + jacobian @ whole @ jacobian.swapaxes(1, 2)
    scaled = b.semi_axes / found.scale
    turns = _turned(b.orientations, inverse[:3, :3] * found.scale)
    sigmas = [np.where(np.isfinite(x), x, np.inf).sum(axis=1) for x in _sigmas(a, b)]
    better = ~np.isfinite(a.semi_axes[pairs_a]).all(axis=1)
    better |= sigmas[1][pairs_b] < sigmas[0][pairs_a]
    better &= np.isfinite(scaled[pairs_b]).all(axis=1)
    semi_axes, log_sigmas = a.semi_axes.copy(), a.log_semi_axes_sigmas.copy()
    orientations, observations = a.orientations.copy(), a.observations.copy()
    observations[pairs_a] += b.observations[pairs_b]
    orientations[pairs_a[better]] = turns[pairs_b[better]]
    semi_axes[pairs_a[better]] = scaled[pairs_b[better]]
    log_sigmas[pairs_a[better]] = b.log_semi_axes_sigmas[pairs_b[better]]
    new = int(a.object_ids.max()) + 1 + np.arange(len(alone))
    merged = replace(
        a,
        name=f"{a.name} and {b.name}",
        object_ids=np.concatenate([a.object_ids, new]),
        class_names=(*a.class_names, *(b.class_names[row] for row in alone.tolist())),
        centers=centers,
        covariances=0.5 * (full + full.swapaxes(1, 2)),
        semi_axes=np.concatenate([semi_axes, scaled[alone]]),
        log_semi_axes_sigmas=np.concatenate([log_sigmas, b.log_semi_axes_sigmas[alone]]),
        orientations=np.concatenate([orientations, turns[alone]]),
        observations=np.concatenate([observations, b.observations[alone]]),
        shares_errors=True,
        results=None,
    )
    return Fused(
        landmarks=merged,
        row_of_a=np.arange(len(a)),
        row_of_b=row_of_b,
        covariance=refined.independent + whole,
        shape_from_b=pairs_a[better],
    )


def _turned(orientations: Floats, rotation: Floats) -> Floats:
    """Return orientations (o, 4) in another frame; NaN stays."""
    from scipy.spatial.transform import Rotation

    turned = np.full_like(orientations, np.nan)
    known = np.isfinite(orientations).all(axis=1)
    if known.any():
        frame = Rotation.from_matrix(rotation)
        turned[known] = (frame * Rotation.from_quat(orientations[known])).as_quat()
    return turned


def _sigmas(a: Landmarks, b: Landmarks) -> tuple[Floats, Floats]:
    return a.log_semi_axes_sigmas, b.log_semi_axes_sigmas


def _parts(landmarks: Landmarks, refined: Refined, inflation: float) -> tuple[Floats, Floats]:
    """Return the covariance of the motion of a map (6, 6), and of each object beside it (o, 3, 3).

    An unknown covariance is half of what the pairs show.
    """
    covariances = landmarks.covariances.copy()
    known = landmarks.has_covariance
    covariances[~known] = 0.5 * np.median(refined.pair_covariances, axis=0)
    covariances[known] *= inflation
    whole = np.zeros((6, 6))
    if landmarks.shares_errors and known.all() and len(landmarks) > 3:
        whole = common_motion(landmarks.centers, covariances, _SPACE, None)
    jacobian = tangent(landmarks.centers, _SPACE)
    own = covariances - jacobian @ whole @ jacobian.swapaxes(1, 2)
    values, vectors = np.linalg.eigh(own)
    least = _LEAST_OWN * np.trace(covariances, axis1=1, axis2=2)[:, None] / 3.0
    values = np.maximum(values, least)
    return whole, np.asarray((vectors * values[:, None, :]) @ vectors.swapaxes(1, 2))
