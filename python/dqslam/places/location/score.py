"""How well poses explain the boxes of images, and the poses that explain them best.

At a pose, each object in view has a box with its rate of detection, and each box shows one of these
objects or none. The score is the logarithm of the probability of the boxes at the pose with the
best assignment, relative to that of an image which shows nothing of the map.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.places.location.place_map import AHEAD, MOST_OBJECTS, ImageBoxes, PlaceMap
from dqslam.places.visibility import view_objects

SE3 = _core.PoseModel.SE3
# Share of the boxes of objects whose errors are larger, and how many times.
WIDE_SHARE, WIDER = 0.1, 3.0
# The angle [rad] to the nearest view of the map at which the variance of a box is twice that of the
# map's boxes, and the most that it grows by.
_NEW_VIEW, _MOST_NEW = 0.5, 4.0
# Factors of the rates of detection in an image, and their shares of images.
QUALITIES = ((1.0, 0.5), (0.6, 0.3), (0.3, 0.2))
# Boxes farther than this from a prediction, in sides of both, do not show the object.
_GATE, _GATE_PX = 1.0, 20.0
_LOG_2PI = float(np.log(2.0 * np.pi))
# Rounds of Levenberg-Marquardt between two assignments, and its first damping.
_ROUNDS, _DAMPING = 4, 1e-3
# Sigma of the orientation before anything is seen [rad]: any.
_ANY_ANGLE = 1.8


@dataclass(frozen=True, eq=False)
class Frame:
    """An image, and where its camera was relative to that of the reference image."""

    boxes: ImageBoxes
    reference_from_image: Floats
    """Shape (7,)."""
    covariance: Floats
    """Of that, in the tangent of the image's pose, shape (6, 6)."""


@dataclass(frozen=True, eq=False)
class Matches:
    """Boxes of hypotheses and the objects that they show, one row each."""

    hypothesis: Ints
    frame: Ints
    box: Ints
    object_row: Ints

    def select(self, hypotheses: Ints) -> Self:
        """Return the rows of some hypotheses, which get the numbers 0, 1, ... in that order."""
        order = np.full(max(self.hypothesis.max(initial=-1), hypotheses.max(initial=-1)) + 1, -1)
        order[hypotheses] = np.arange(len(hypotheses))
        keep = order[self.hypothesis] >= 0
        return replace(
            self,
            hypothesis=order[self.hypothesis[keep]],
            frame=self.frame[keep],
            box=self.box[keep],
            object_row=self.object_row[keep],
        )


@dataclass(frozen=True, eq=False)
class Scored:
    """Hypotheses with their scores."""

    poses: Floats
    """world_from_camera of the reference image, shape (h, 7)."""
    score: Floats
    """Shape (h,)."""
    matches: Matches
    missing: Ints
    """Number of objects that each expects in vain, with a rate above one half; shape (h,)."""

    def select(self, rows: Ints) -> Self:
        """Return some of the hypotheses."""
        return replace(
            self,
            poses=self.poses[rows],
            score=self.score[rows],
            matches=self.matches.select(rows),
            missing=self.missing[rows],
        )


class Scorer:
    """Scores and refines poses in a map."""

    def __init__(self, place: PlaceMap, camera: _core.Camera, frames: list[Frame]) -> None:
        """Take a map, the camera without a mount, and images."""
        self.place, self.camera, self.frames = place, camera, frames

    def image_poses(self, poses: Floats, frame: int) -> Floats:
        """Return world_from_camera of an image for poses (h, 7) of the reference image."""
        offset = np.broadcast_to(self.frames[frame].reference_from_image, poses.shape)
        return _core.compose(SE3, poses, offset)

    def score(self, poses: Floats) -> Scored:
        """Score poses (h, 7) of the reference image."""
        total, missing = np.zeros(len(poses)), np.zeros(len(poses), dtype=np.int64)
        parts: list[tuple[Ints, Ints, Ints, Ints]] = []
        for number in range(len(self.frames)):
            score, absent, (row, box, shown) = self._score_image(poses, number)
            total += score
            missing += absent
            parts.append((row, np.full(len(row), number), box, shown))
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        return Scored(poses, total, Matches(*columns), missing)

    def _score_image(
        self, poses: Floats, number: int
    ) -> tuple[Floats, Ints, tuple[Ints, Ints, Ints]]:
        """Return scores (h,), missing objects (h,), and hypothesis, box and object of matches."""
        frame, at = self.frames[number], self.image_poses(poses, number)
        rows = self._objects_near(at)
        views = view_objects(self.camera, at, self.place.ellipsoids[rows])
        rate = self.place.sensor.detection_rate(views, rows)
        image = frame.boxes
        h, b, column = self._possible(views.box, rate, image)
        shown = rows[h, column]
        matches = Matches(h, np.full(len(h), number), b, shown)
        covariance, _ = self.total_covariance(matches, at[h])
        log_box = self._log_box(at[h], shown, image, b, covariance)
        odds = np.log(rate[h, column]) - np.log1p(-rate[h, column])
        shows = image.log_label[b, shown] + log_box - image.log_false[b]
        gain = odds + shows
        score = np.zeros(len(at))
        chosen = []
        positive = np.flatnonzero(gain > 0.0)
        bounds = np.searchsorted(h[positive], np.arange(len(at) + 1))
        for one in range(len(at)):
            own = positive[bounds[one] : bounds[one + 1]]
            best = _assign(b[own], column[own], gain[own])
            score[one] = shows[own[best]].sum()
            chosen.append(own[best])
        picked = np.concatenate(chosen) if chosen else np.zeros(0, dtype=np.int64)
        found = np.zeros(rate.shape, dtype=bool)
        found[h[picked], column[picked]] = True
        score += _log_found(rate, found)
        return score, ((rate > 0.5) & ~found).sum(axis=1), (h[picked], b[picked], shown[picked])

    def _objects_near(self, at: Floats) -> Ints:
        """Return the rows of objects near each camera, (h, s): all in a small map."""
        count = len(self.place.ellipsoids)
        if count <= MOST_OBJECTS:
            return np.tile(np.arange(count), (len(at), 1))
        # A point ahead is nearer to what is in view than the camera itself.
        forward = _core.compose(
            SE3, at, np.tile([0, 0, AHEAD * self.place.sensor.sight, 0, 0, 0, 1.0], (len(at), 1))
        )
        _, rows = self.place.tree.query(forward[:, :3], k=self.place.in_reach)
        return np.sort(rows, axis=1)

    def _possible(
        self, predicted: Floats, rate: Floats, image: ImageBoxes
    ) -> tuple[Ints, Ints, Ints]:
        """Return hypothesis, box and column of boxes near predictions (h, s, 4)."""
        middle = 0.5 * (predicted[..., :2] + predicted[..., 2:])
        side = predicted[..., 2:] - predicted[..., :2]
        own_middle = 0.5 * (image.box[:, :2] + image.box[:, 2:])
        own_side = image.box[:, 2:] - image.box[:, :2]
        apart = np.abs(middle[:, None] - own_middle[None, :, None])
        # A cut box shows the middle of what is left of the object.
        wide = np.where(image.truncated.any(axis=1), 2.0, 1.0)[None, :, None, None]
        limit = _GATE * wide * 0.5 * (side[:, None] + own_side[None, :, None]) + _GATE_PX
        near = (apart < limit).all(axis=-1) & (rate > 0.0)[:, None]
        h, b, column = np.nonzero(near)
        return h, b, column

    def total_covariance(self, matches: Matches, at: Floats) -> tuple[Floats, Floats]:
        """Return covariances (m, 4, 4) of boxes minus predictions without the error of the pose.

        Also return the Jacobians (m, 4, 6) by the tangents of the poses ``at`` (m, 7) of images.
        """
        rows = matches.object_row
        _, _, jacobian = _core.differentiate_boxes(
            SE3, self.camera, at, self.place.ellipsoids[rows]
        )
        jacobian = np.nan_to_num(jacobian)
        by_pose, by_object = jacobian[:, :, :6], jacobian[:, :, 6:]
        total = by_object @ self.place.covariances[rows] @ by_object.transpose(0, 2, 1)
        # No object is an ellipsoid: from a new side, its outline is not where the map's boxes fit.
        new = (self.place.new_view(rows, at[:, :3]) / _NEW_VIEW) ** 2
        wider = 1.0 + np.minimum(new, _MOST_NEW)[:, None, None]
        for number, frame in enumerate(self.frames):
            own = matches.frame == number
            drift = by_pose[own] @ frame.covariance @ by_pose[own].transpose(0, 2, 1)
            total[own] += wider[own] * frame.boxes.covariance[matches.box[own]] + drift
        return total, by_pose

    def _log_box(
        self, at: Floats, rows: Ints, image: ImageBoxes, box: Ints, covariance: Floats
    ) -> Floats:
        """Return the logarithms of the densities of boxes (m,) of objects at poses (m, 7)."""
        chi2 = self.chi_squares(at, rows, image, box, covariance)
        free = ~image.truncated[box]
        variance = np.diagonal(covariance, axis1=1, axis2=2)
        peak = -0.5 * (np.where(free, np.log(variance) + _LOG_2PI, 0.0)).sum(axis=1)
        wide = peak - free.sum(axis=1) * np.log(WIDER) - 0.5 * chi2 / WIDER**2
        narrow = np.log1p(-WIDE_SHARE) + peak - 0.5 * chi2
        return np.asarray(np.logaddexp(narrow, np.log(WIDE_SHARE) + wide))

    def chi_squares(
        self, at: Floats, rows: Ints, image: ImageBoxes, box: Ints, covariance: Floats
    ) -> Floats:
        """Return the chi-squares of boxes (m,) of objects at poses (m, 7)."""
        return _core.box_chi_squares(
            SE3,
            self.camera,
            at,
            self.place.ellipsoids[rows],
            image.box[box],
            covariance.reshape(-1, 16),
            image.truncated[box],
        )

    def refine(self, scored: Scored) -> tuple[Floats, Floats]:
        """Move poses to where they fit their matches best.

        Return the poses (h, 7) and the information in their tangents (h, 6, 6).
        """
        poses, matches = scored.poses, scored.matches
        damping = np.full(len(poses), _DAMPING)
        cost, information, gradient = self.linearize(poses, matches)
        for _ in range(_ROUNDS):
            scale = np.diagonal(information, axis1=1, axis2=2)[:, :, None] * np.eye(6)
            step = np.linalg.solve(
                information + damping[:, None, None] * scale, -gradient[:, :, None]
            )[:, :, 0]
            moved = _core.plus(SE3, poses, step)
            new_cost, new_information, new_gradient = self.linearize(moved, matches)
            better = new_cost < cost
            poses = np.where(better[:, None], moved, poses)
            cost = np.where(better, new_cost, cost)
            information = np.where(better[:, None, None], new_information, information)
            gradient = np.where(better[:, None], new_gradient, gradient)
            damping = np.where(better, damping * 0.1, damping * 30.0)
        return poses, information

    def linearize(self, poses: Floats, matches: Matches) -> tuple[Floats, Floats, Floats]:
        """Return cost (h,), information (h, 6, 6) and gradient (h, 6) of poses."""
        count = len(poses)
        weak = np.repeat([1.0 / self.place.sensor.sight**2, 1.0 / _ANY_ANGLE**2], 3)
        information = np.tile(np.diag(weak), (count, 1, 1))
        gradient, cost = np.zeros((count, 6)), np.zeros(count)
        at = np.zeros((len(matches.box), 7))
        turn = np.zeros((len(matches.box), 6, 6))
        measured = np.zeros((len(matches.box), 4))
        cut = np.zeros((len(matches.box), 4), dtype=bool)
        for number, frame in enumerate(self.frames):
            own = np.flatnonzero(matches.frame == number)
            at[own] = self.image_poses(poses, number)[matches.hypothesis[own]]
            back = _core.inverse(SE3, frame.reference_from_image[None])
            turn[own] = _core.adjoint(SE3, back)
            measured[own] = frame.boxes.box[matches.box[own]]
            cut[own] = frame.boxes.truncated[matches.box[own]]
        covariance, by_pose = self.total_covariance(matches, at)
        predicted, front = _core.project_to_boxes(
            SE3, self.camera, at, self.place.ellipsoids[matches.object_row]
        )
        error = np.nan_to_num(predicted - measured)
        # Beyond the border nobody sees where a box ends.
        outward = error * np.array([-1.0, -1.0, 1.0, 1.0])
        hidden = cut & (outward > 0.0)
        error = np.where(hidden, 0.0, error)
        jacobian = np.where(hidden[:, :, None], 0.0, by_pose @ turn)
        inverse = np.linalg.inv(covariance)
        chi2 = np.where(front, np.einsum("mi,mij,mj->m", error, inverse, error), np.inf)
        narrow = np.log1p(-WIDE_SHARE) - 0.5 * chi2
        wide = np.log(WIDE_SHARE / WIDER**4) - 0.5 * chi2 / WIDER**2
        total = np.logaddexp(narrow, wide)
        share = np.where(front, np.exp(narrow - np.where(front, total, 0.0)), 0.0)
        weight = share + (1.0 - share) / WIDER**2
        whitened = weight[:, None, None] * (jacobian.transpose(0, 2, 1) @ inverse)
        np.add.at(information, matches.hypothesis, whitened @ jacobian)
        np.add.at(gradient, matches.hypothesis, np.einsum("mij,mj->mi", whitened, error))
        np.add.at(cost, matches.hypothesis, -total)
        return cost, information, gradient


def _log_found(rate: Floats, found: Bools) -> Floats:
    """Return the log probability that a detector finds just these objects (h, s) of an image.

    Images differ: blur, light and a new side make a detector miss many objects at once.
    """
    logs = [
        np.log(share)
        + np.where(found, np.log(factor * np.maximum(rate, 1e-12)), np.log1p(-factor * rate)).sum(
            axis=1
        )
        for factor, share in QUALITIES
    ]
    return np.asarray(np.logaddexp.reduce(logs, axis=0))


def _assign(box: Ints, column: Ints, gain: Floats) -> Ints:
    """Choose the rows whose gains have the largest sum, a box and an object once each."""
    from scipy.optimize import linear_sum_assignment

    if not len(gain):
        return np.zeros(0, dtype=np.int64)
    boxes, b = np.unique(box, return_inverse=True)
    columns, c = np.unique(column, return_inverse=True)
    table = np.zeros((len(boxes), len(columns)))
    table[b, c] = gain
    row = np.full(table.shape, -1)
    row[b, c] = np.arange(len(gain))
    chosen = row[linear_sum_assignment(table, maximize=True)]
    return np.asarray(chosen[chosen >= 0])
