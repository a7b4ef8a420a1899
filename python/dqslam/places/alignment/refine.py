"""The motion between two maps from their pairs, and how uncertain it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.places.alignment.likelihood import log_student, tangent
from dqslam.places.alignment.rigid import MotionModel, Motions
from dqslam.places.landmarks import Landmarks

FREEDOMS = (1.0, 2.0, 4.0, 16.0)
"""Degrees of freedom that are tried: from Cauchy's distribution to nearly the normal one."""
_ROUNDS = 30
_CONVERGED = 1e-8
# Of the influence of an error: that of the few pairs of a small map may vanish by accident.
_LEAST_SLOPE = 0.2
# Pairs that stand for what is known before: of a class, that it errs as all do, and of all, that
# they err as the files say.
_BEFORE = 4.0


@dataclass(frozen=True, eq=False)
class Refined:
    """A motion and its uncertainty."""

    motion: Motions
    """A batch of one."""
    covariance: Floats
    """Of a small motion in the frame of A, x y z [m] and rotation vector [rad], (6, 6)."""
    independent: Floats
    """The part of it that is not of a map as a whole, (6, 6)."""
    scale_sigma: float
    """Of the logarithm of the scale; 0 if it is 1."""
    pair_covariances: Floats
    """Of the differences of the pairs in B, as found, square meters, (p, 3, 3)."""
    factors: Floats
    """How much larger the variances are than the files say, of each pair and axis, (p, 3)."""
    differences: Floats
    """Of the pairs, B minus moved A, meters, (p, 3)."""
    freedom: tuple[float, ...]
    """Degrees of freedom of the distribution of the errors: in the plane and of heights if z is up,
    else of all."""
    log_likelihoods: tuple[float, ...]
    """Of the differences, likewise."""


def refine(
    a: Landmarks,
    b: Landmarks,
    pairs: Ints,
    start: Motions,
    model: MotionModel,
    sigma: float,
    freedom: tuple[float, ...] | None = None,
) -> Refined:
    """Fit a motion to pairs of rows (p, 2), each with the errors of its class.

    ``sigma`` [m] is that of a coordinate of a center whose covariance is unknown. The errors have
    Student's distribution, by default with the degrees of freedom that make them most likely. They
    are scaled by what is seen, by class and, where z is up, for heights apart from the plane.
    """
    if freedom is None:
        parts = len(_parts(model))
        fits = [refine(a, b, pairs, start, model, sigma, (one,) * parts) for one in FREEDOMS]
        likely = np.argmax([fit.log_likelihoods for fit in fits], axis=0).tolist()
        freedom = tuple(FREEDOMS[row] for row in likely)
    rows_a, rows_b = pairs.T
    p, q = a.centers[rows_a], b.centers[rows_b]
    of_class = np.unique([a.class_names[row] for row in rows_a.tolist()], return_inverse=True)[1]
    known = bool(a.has_covariance[rows_a].all() and b.has_covariance[rows_b].all())
    given = [_filled(x.covariances[r], sigma) for x, r in ((a, rows_a), (b, rows_b))]
    rotation, translation, scale = start.rotation[0], start.translation[0], float(start.scale[0])
    factor = np.ones((len(p), 3))
    for _ in range(_ROUNDS):
        turned = scale * rotation
        base = turned @ given[0] @ turned.T + given[1]
        difference = q - p @ turned.T - translation
        factor = _scales(difference, base, factor, of_class, model, freedom, known)
        root = np.sqrt(factor)
        covariance = root[:, :, None] * base * root[:, None, :]
        weighted = _weighted_inverse(difference, covariance, model, freedom)
        jacobian = turned @ tangent(p, model)
        weighted = jacobian.swapaxes(1, 2) @ weighted
        information = (weighted @ jacobian).sum(axis=0)
        step = np.linalg.lstsq(
            information, (weighted @ difference[:, :, None]).sum(axis=0)[:, 0], rcond=None
        )[0]
        translation = translation + turned @ step[:3]
        rotation = rotation @ _turn(step, model)
        scale = scale * float(np.exp(step[-1])) if model.has_scale else scale
        if np.abs(step).max() < _CONVERGED:
            break
    root = np.sqrt(_lost(difference, covariance, model, freedom))
    inverse = np.linalg.inv(root[:, :, None] * covariance * root[:, None, :])
    information = (jacobian.swapaxes(1, 2) @ inverse @ jacobian).sum(axis=0)
    spread = np.linalg.pinv(information, hermitian=True)
    independent = _in_space(spread, model)
    full = independent
    motion = Motions(rotation[None], translation[None], np.array([scale]))
    for landmarks, rows, moved in ((a, rows_a, None), (b, rows_b, motion)):
        if landmarks.shares_errors and landmarks.has_covariance[rows].all() and len(rows) > 3:
            full = full + common_motion(
                landmarks.centers[rows], landmarks.covariances[rows], model, moved
            )
    return Refined(
        motion=motion,
        covariance=0.5 * (full + full.T),
        independent=independent,
        scale_sigma=float(np.sqrt(spread[-1, -1])) if model.has_scale else 0.0,
        pair_covariances=covariance,
        factors=factor,
        differences=q - p @ (scale * rotation).T - translation,
        freedom=freedom,
        log_likelihoods=_log_likelihoods(difference, covariance, model, freedom),
    )


def _log_likelihoods(
    difference: Floats, covariance: Floats, model: MotionModel, freedom: tuple[float, ...]
) -> tuple[float, ...]:
    likelihoods = []
    for axis, free in zip(_parts(model), freedom, strict=True):
        given = covariance[:, axis, axis]
        square, (_, logdet) = _squares(difference[:, axis], given), np.linalg.slogdet(given)
        one = log_student(square, np.ones(len(square)), axis.stop - axis.start, free)
        likelihoods.append(float((one - 0.5 * logdet).sum()))
    return tuple(likelihoods)


def _filled(covariances: Floats, sigma: float) -> Floats:
    unknown = ~np.isfinite(covariances).all(axis=(1, 2))
    filled = covariances.copy()
    filled[unknown] = sigma**2 * np.eye(3)
    return filled


def _parts(model: MotionModel) -> list[slice]:
    """Return the axes whose errors belong together: upright, heights err for other reasons."""
    return [slice(0, 2), slice(2, 3)] if model.upright else [slice(0, 3)]


def _t_weights(difference: Floats, covariance: Floats, freedom: float) -> Floats:
    """Return the weights (p,) of Student's t for differences (p, k) of covariances (p, k, k)."""
    square = _squares(difference, covariance)
    return np.asarray((freedom + difference.shape[1]) / (freedom + square))


def _squares(difference: Floats, covariance: Floats) -> Floats:
    solved = np.linalg.solve(covariance, difference[:, :, None])[:, :, 0]
    return np.asarray((difference * solved).sum(axis=1))


def _weighted_inverse(
    difference: Floats, covariance: Floats, model: MotionModel, freedom: tuple[float, ...]
) -> Floats:
    """Return the inverses of covariances (p, 3, 3), each axis with the weight of its part."""
    root = np.ones_like(difference)
    for axis, free in zip(_parts(model), freedom, strict=True):
        root[:, axis] = np.sqrt(_t_weights(difference[:, axis], covariance[:, axis, axis], free))[
            :, None
        ]
    return np.asarray(root[:, :, None] * np.linalg.inv(covariance) * root[:, None, :])


def _lost(
    difference: Floats, covariance: Floats, model: MotionModel, freedom: tuple[float, ...]
) -> Floats:
    """Return how much more the fit varies than the mean of errors of these covariances; (p, 3).

    It is the ratio of the mean square of the influence to the squared mean of its derivative, as
    the errors are, whether or not their distribution is Student's.
    """
    factor = np.ones_like(difference)
    for axis, free in zip(_parts(model), freedom, strict=True):
        size = axis.stop - axis.start
        square = _squares(difference[:, axis], covariance[:, axis, axis])
        weight = (free + size) / (free + square)
        influence = np.mean(weight**2 * square) / size
        slope = np.mean(weight - 2.0 * weight**2 * square / ((free + size) * size))
        share = max(1.0 - model.size / (3.0 * len(square)), 1.0 / len(square))
        factor[:, axis] = max(influence, 1e-6) / max(slope, _LEAST_SLOPE) ** 2 / share
    return factor


def _scales(
    difference: Floats,
    base: Floats,
    factor: Floats,
    of_class: Ints,
    model: MotionModel,
    freedom: tuple[float, ...],
    known: bool,
) -> Floats:
    """Return factors (p, 3) on the variances of each axis, from those before."""
    result = np.ones_like(factor)
    for axis, free in zip(_parts(model), freedom, strict=True):
        part, given = difference[:, axis], base[:, axis, axis]
        weight = _t_weights(part, given * factor[:, axis][:, :1, None], free)
        each = weight * _squares(part, given) / part.shape[1]
        # The motion fits its own degrees of freedom.
        share = max(1.0 - model.size / (3.0 * len(each)), 1.0 / len(each))
        before = _BEFORE if known else 0.0
        overall = (each.sum() + before) / (share * len(each) + before)
        for number in range(int(of_class.max()) + 1):
            rows = of_class == number
            total = each[rows].sum() + _BEFORE * overall
            result[rows, axis] = total / (share * rows.sum() + _BEFORE)
    return np.maximum(result, 1e-6)


def _turn(step: Floats, model: MotionModel) -> Floats:
    from scipy.spatial.transform import Rotation

    vector = np.array([0.0, 0.0, step[3]]) if model.upright else step[3:6]
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def _in_space(covariance: Floats, model: MotionModel) -> Floats:
    """Return the covariance of all six degrees of freedom; 0 for those that gravity fixes."""
    rows = [0, 1, 2, 5] if model.upright else [0, 1, 2, 3, 4, 5]
    full = np.zeros((6, 6))
    full[np.ix_(rows, rows)] = covariance[: len(rows), : len(rows)]
    return full


def common_motion(
    points: Floats, covariances: Floats, model: MotionModel, b_from_a: Motions | None
) -> Floats:
    """Return the covariance (6, 6) of the motion that the errors of points have in common.

    A map that is turned as a whole has errors that grow with the distance from its first pose. No
    difference between maps shows them. Marginal covariances are explained by a motion of all points
    and an error of each. What the motion explains is in the frame of A, from that of B if b_from_a
    is given.
    """
    middle = points.mean(axis=0)
    plain = MotionModel(upright=model.upright, has_scale=False)
    jacobian = tangent(points - middle, plain)
    size = jacobian.shape[2]
    upper, lower = np.triu_indices(size)
    basis = np.zeros((len(upper), size, size))
    basis[np.arange(len(upper)), upper, lower] = basis[np.arange(len(upper)), lower, upper] = 1.0
    columns = [jacobian @ one @ jacobian.swapaxes(1, 2) for one in basis]
    columns.append(np.tile(np.eye(3), (len(points), 1, 1)))
    matrix = np.stack([column.ravel() for column in columns], axis=1)
    scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-12)
    found = np.linalg.lstsq(matrix / scale, covariances.ravel(), rcond=1e-8)[0] / scale
    values, vectors = np.linalg.eigh(np.einsum("k,kij->ij", found[:-1], basis))
    motion = _in_space((vectors * np.maximum(values, 0.0)) @ vectors.T, model)
    # From turns about the middle to turns about the origin.
    shift = np.eye(6)
    x, y, z = middle
    shift[:3, 3:] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    if b_from_a is not None:
        shift = _adjoint_of_inverse(b_from_a) @ shift
    return np.asarray(shift @ motion @ shift.T)


def _adjoint_of_inverse(b_from_a: Motions) -> Floats:
    """Return what takes a small motion in the frame of B to that in the frame of A, (6, 6)."""
    from scipy.spatial.transform import Rotation

    se3 = _core.PoseModel.SE3
    quaternion = Rotation.from_matrix(b_from_a.rotation[0]).as_quat()
    pose = np.concatenate([b_from_a.translation[0], quaternion])[None]
    (found,) = _core.adjoint(se3, _core.inverse(se3, pose))
    found = np.array(found)
    found[:3] /= b_from_a.scale[0]
    return found
