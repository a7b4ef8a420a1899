"""What a detector does with the objects of a map, learned from the boxes of the map's own images.

A result folder has the boxes of all images, and the object that each shows. From these follow the
noise of boxes, the rate at which an object in view gets a box, the labels that it gets, and the
number of boxes that show nothing in the map. A map without boxes has assumed values.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.assumptions import BoxNoise
from dqslam.io import BoxTable
from dqslam.places.visibility import Views, view_objects

# Bounds of the apparent sizes [px] among which rates of detection are learned.
SIZES = np.array([12.0, 20.0, 32.0, 50.0, 80.0, 130.0])
# An object is hidden if a nearer one covers more than this share of its box.
HIDDEN = 0.5
# An object is expected in an image if more than this share of its box is inside.
EXPECTED_IN_IMAGE = 0.5
# No object is found, or missed, more surely than this.
RATES = (0.01, 0.97)
# Assumed of a detector without boxes to learn from: rate, false boxes an image, wrong labels.
ASSUMED_RATE, ASSUMED_FALSE, ASSUMED_CONFUSION = 0.6, 1.0, 0.05
# Assumed boxes an image without boxes to learn from, and the fewest false ones: places change.
ASSUMED_ALL, LEAST_FALSE = 8.0, 0.5
# Images, at most, from which is learned, evenly spaced.
MOST_IMAGES = 300
# Parts of the boxes, by score, whose variances are compared; the least range of scores that tells
# anything, and the most that a score changes a variance by.
_SCORE_PARTS, _LEAST_RANGE, _MOST_BY_SCORE = 8, 0.1, 4.0
# Boxes as which an assumed rate counts.
_PRIOR_BOXES = 4.0


@dataclass(frozen=True, eq=False)
class Sensor:
    """A detector and the objects of a map."""

    noise: BoxNoise
    """Of the edges of boxes of objects at their places."""
    correlation: float
    """Between the errors of opposite edges: a box is rather shifted than too large."""
    score_slope: float
    """Boxes of a low score err more: the logarithm of the variance falls by this per unit of it."""
    usual_score: float
    """Score of boxes whose noise is ``noise``."""
    tail: float
    """How many times larger the mean variance of boxes is: ``noise`` is that of most of them."""
    false_boxes: float
    """Mean number of boxes an image that show no object of the map."""
    all_boxes: float
    """Mean number of boxes an image."""
    labels: tuple[str, ...]
    """Class names that boxes or objects have."""
    log_label: Floats
    """Logarithm of the share of an object's boxes with each label, shape (o, labels)."""
    log_false_label: Floats
    """Logarithm of the share of false boxes with each label, shape (labels + 1,): last unknown."""
    log_any_label: Floats
    """Likewise of all boxes."""
    rates: Floats
    """Rate of detection by apparent size, shape (sizes, 2): in sight, hidden."""
    rate_shift: Floats
    """Log-odds by which the rate of each object differs from that, shape (o,)."""
    sight: float
    """Distance within which objects are seen, meters."""

    def box_covariance(self, box: Floats, score: Floats, camera: _core.Camera) -> Floats:
        """Return the covariance [px^2] of the edges of boxes (b, 4) of scores (b,), (b, 4, 4)."""
        factor = np.exp(self.score_slope * (self.usual_score - score))
        factor = np.clip(factor, 1.0 / _MOST_BY_SCORE, _MOST_BY_SCORE)
        covariance = factor[:, None, None] * self.noise.covariance(box, camera)
        sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        for low in (0, 1):
            both = self.correlation * sigma[:, low] * sigma[:, low + 2]
            covariance[:, low, low + 2] = covariance[:, low + 2, low] = both
        return covariance

    def detection_rate(self, views: Views, rows: Ints | None = None) -> Floats:
        """Return the probability that each object gets a box, shape (n, o).

        The objects are all of the map, or those of ``rows`` (n, o).
        """
        size = np.searchsorted(SIZES, views.size)
        rate = self.rates[size, (views.covered > HIDDEN).astype(np.int64)]
        rate = _from_log_odds(
            _log_odds(rate) + self.rate_shift[slice(None) if rows is None else rows]
        )
        # A part of an object at the border is found less often, by an unknown amount.
        seen = np.clip(views.in_image / EXPECTED_IN_IMAGE - 0.5, 0.0, 1.0)
        return np.asarray(np.clip(rate * seen, 1e-3, RATES[1]))


def assumed_sensor(class_names: tuple[str, ...], sight: float) -> Sensor:
    """Return the sensor of a map that has no boxes; ``class_names`` (o,) are its objects'."""
    labels = tuple(sorted(set(class_names)))
    counts = np.array([[name == label for label in labels] for name in class_names], dtype=float)
    return Sensor(
        noise=BoxNoise(),
        correlation=0.0,
        score_slope=0.0,
        usual_score=1.0,
        tail=1.0,
        false_boxes=ASSUMED_FALSE,
        all_boxes=ASSUMED_ALL,
        labels=labels,
        log_label=_log_labels(np.zeros_like(counts), counts),
        log_false_label=_log_shares(np.zeros(len(labels))),
        log_any_label=_log_shares(counts.sum(axis=0)),
        rates=np.full((len(SIZES) + 1, 2), ASSUMED_RATE) * [1.0, 0.5],
        rate_shift=np.zeros(len(class_names)),
        sight=sight,
    )


def learn_sensor(
    camera: _core.Camera,
    poses: Floats,
    boxes: BoxTable,
    object_ids: Ints,
    class_names: tuple[str, ...],
    ellipsoids: Floats,
) -> Sensor:
    """Learn from the boxes of a result, whose poses are (n, 7) and whose objects are (o,)."""
    row_of = {number: row for row, number in enumerate(object_ids.tolist())}
    shown = np.array([row_of.get(number, -1) for number in boxes.object_id.tolist()], dtype=int)
    labels = tuple(sorted(set(class_names) | set(boxes.class_name)))
    label_of = {name: column for column, name in enumerate(labels)}
    label = np.array([label_of[name] for name in boxes.class_name], dtype=int)
    own = np.zeros((len(class_names), len(labels)))
    own[np.arange(len(class_names)), [label_of[name] for name in class_names]] = 1.0
    counts = np.zeros_like(own)
    np.add.at(counts, (shown[shown >= 0], label[shown >= 0]), 1.0)
    images = np.unique(boxes.pose)
    count = len(images)
    images = images[:: -(-len(images) // MOST_IMAGES)]
    views = view_objects(camera, poses[images], ellipsoids)
    rates, shift = _learn_rates(views, images, boxes.pose, shown)
    used = np.flatnonzero((shown >= 0) & ~boxes.truncated.any(axis=1))
    used = used[:: -(-max(len(used), 1) // 5000)]
    object_in_view = ellipsoids[shown[shown >= 0], :3] - poses[boxes.pose[shown >= 0], :3]
    distance = np.linalg.norm(object_in_view, axis=1)
    noise, correlation, slope, tail = _learn_noise(camera, poses, boxes, ellipsoids, used, shown)
    return Sensor(
        noise=noise,
        correlation=correlation,
        score_slope=slope,
        usual_score=float(np.mean(boxes.score[used])) if len(used) else 1.0,
        tail=tail,
        false_boxes=max(float(np.sum(shown < 0)) / count, LEAST_FALSE),
        all_boxes=len(boxes) / count,
        labels=labels,
        log_label=_log_labels(counts, own),
        log_false_label=_log_shares(np.bincount(label[shown < 0], minlength=len(labels))),
        log_any_label=_log_shares(np.bincount(label, minlength=len(labels))),
        rates=rates,
        rate_shift=shift,
        sight=float(np.quantile(distance, 0.99)) if distance.size else np.inf,
    )


def _log_labels(counts: Floats, own: Floats) -> Floats:
    """Return the logarithms of the shares of labels; what was never seen remains possible."""
    prior = (1.0 - ASSUMED_CONFUSION) * own + ASSUMED_CONFUSION / own.shape[1]
    total = counts.sum(axis=1, keepdims=True) + _PRIOR_BOXES
    return np.asarray(np.log((counts + _PRIOR_BOXES * prior) / total))


def _log_shares(counts: Floats | Ints) -> Floats:
    """Return the logarithms of shares of labels (n,), and of that of all others; (n + 1,)."""
    more = np.append(counts, 0.0) + 1.0
    return np.asarray(np.log(more / more.sum()))


def _learn_rates(views: Views, images: Ints, box_pose: Ints, shown: Ints) -> tuple[Floats, Floats]:
    found = np.zeros(views.size.shape, dtype=bool)
    image = np.searchsorted(images, box_pose)
    image[image == len(images)] = 0
    known = (images[image] == box_pose) & (shown >= 0)
    found[image[known], shown[known]] = True
    expected = views.in_image > EXPECTED_IN_IMAGE
    size = np.searchsorted(SIZES, views.size)
    hidden = (views.covered > HIDDEN).astype(int)
    rates = np.zeros((len(SIZES) + 1, 2))
    for one in range(len(SIZES) + 1):
        for side in (0, 1):
            cell = expected & (size == one) & (hidden == side)
            assumed = ASSUMED_RATE * (1.0 - 0.5 * side)
            rates[one, side] = (found[cell].sum() + _PRIOR_BOXES * assumed) / (
                cell.sum() + _PRIOR_BOXES
            )
    rates = np.clip(rates, *RATES)
    predicted = np.where(expected, rates[size, hidden], 0.0).sum(axis=0)
    count = expected.sum(axis=0) + 2 * _PRIOR_BOXES
    usual = np.clip((predicted + _PRIOR_BOXES) / count, *RATES)
    own = np.clip(((found & expected).sum(axis=0) + _PRIOR_BOXES) / count, *RATES)
    return rates, _log_odds(own) - _log_odds(usual)


def _log_odds(probability: Floats) -> Floats:
    return np.asarray(np.log(probability) - np.log1p(-probability))


def _from_log_odds(log_odds: Floats) -> Floats:
    return np.asarray(1.0 / (1.0 + np.exp(-log_odds)))


def _learn_noise(
    camera: _core.Camera,
    poses: Floats,
    boxes: BoxTable,
    ellipsoids: Floats,
    used: Ints,
    shown: Ints,
) -> tuple[BoxNoise, float, float, float]:
    """Fit the two parts of the noise to robust variances of edges, by the sides of their boxes.

    Also return the correlation of opposite edges, by how much the logarithm of the variance falls
    per unit of the score, and how many times larger the mean variance is than the robust one.
    """
    from scipy.optimize import nnls

    box, front = _core.project_to_boxes(
        _core.PoseModel.SE3, camera, poses[boxes.pose[used]], ellipsoids[shown[used]]
    )
    used, box = used[front], box[front]
    if len(used) < 50:
        return BoxNoise(), 0.0, 0.0, 1.0
    measured = boxes.box[used]
    error = (measured - box).ravel()
    side = np.tile(measured[:, 2:] - measured[:, :2], (1, 2)).ravel()
    groups = np.array_split(np.argsort(side), 8)
    # The median of the squares of a normal distribution is 0.455 of its variance.
    variance = np.array([np.median(error[rows] ** 2) / 0.455 for rows in groups])
    squares = np.array([np.mean(side[rows] ** 2) for rows in groups])
    weight = 1.0 / (variance + 0.25)
    design = np.column_stack([np.ones(len(groups)), squares]) * weight[:, None]
    parts, _ = nnls(design, variance * weight)
    noise = BoxNoise(pixels=max(float(np.sqrt(parts[0])), 0.5), relative=float(np.sqrt(parts[1])))
    sigma = np.sqrt(np.diagonal(noise.covariance(measured), axis1=1, axis2=2))
    # Errors of more than three sigmas, as of boxes of other objects, have little weight in a pose.
    whitened = np.clip((measured - box) / sigma, -3.0, 3.0)
    both = float(np.mean(whitened[:, :2] * whitened[:, 2:]) / np.mean(whitened**2))
    slope = _learn_score_slope(whitened, boxes.score[used])
    return noise, float(np.clip(both, 0.0, 0.8)), slope, max(1.0, float(np.mean(whitened**2)))


def _learn_score_slope(whitened: Floats, score: Floats) -> float:
    """Return by how much the logarithm of the variance of errors (m, 4) falls per unit of score.

    0 if it does not fall, or if the scores (m,) are alike.
    """
    parts = np.array_split(np.argsort(score, kind="stable"), _SCORE_PARTS)
    mean = np.array([score[rows].mean() for rows in parts])
    if np.ptp(mean) < _LEAST_RANGE:
        return 0.0
    variance = np.array([np.median(whitened[rows] ** 2) for rows in parts])
    slope = np.polyfit(mean, np.log(np.maximum(variance, 1e-6)), 1)[0]
    return max(0.0, -float(slope))
