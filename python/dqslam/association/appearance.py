"""What boxes look like: how far vectors of appearance tell objects apart, and what they then say.

How similar the vectors of one object are depends on the network that made them, and a recording
shows it. Boxes in one image are of different objects. A box and the most similar one in a later
image are mostly of one object, if the vectors say anything: else they are no more similar to each
other than the most similar boxes within an image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.association.images import group_by_pose
from dqslam.recording import Detections

# Looks count for odds of 50 to 1 at most, as another class does: the view and the light change
# them, and do so in all images in a row.
MOST_LOG_ODDS = float(np.log(50.0))
# Two tracks or objects are not the same if their looks say so with odds of 20 to 1.
CLEARLY_DIFFERENT = float(-np.log(20.0))
# What looks say is learned from so many pairs of boxes at least: of fewer, the spread is chance.
MIN_PAIRS = 20
# A recording is compared with itself a little later: in this many parts. From one image of a video
# to the next, an object looks more alike than when it is seen again.
PARTS = 50
# Similarities, cosines, spread by this at least: below, they are rounded.
LEAST_SPREAD = 1e-3
# The most similar boxes of two images are so many spreads more similar than those of one, or the
# vectors say nothing.
LEAST_DIFFERENCE = 0.5
# Factor from a median absolute deviation to a standard deviation.
SIGMA_OF_MAD = 1.4826


@dataclass(frozen=True)
class Appearance:
    """How similar boxes of one object are, and boxes of two: cosines of their vectors."""

    same: float
    different: float
    spread: float
    """Standard deviation of both."""

    def log_odds(self, similarity: Floats) -> Floats:
        """Return ln of p(similarity | same object) / p(similarity | two objects), any shape.

        Of normal distributions of one spread, and never more than of ``MOST_LOG_ODDS``. The
        similarity of a box to an object is its mean similarity to the boxes of the object.
        """
        slope = (self.same - self.different) / self.spread**2
        odds = slope * (similarity - 0.5 * (self.same + self.different))
        return np.asarray(np.clip(odds, -MOST_LOG_ODDS, MOST_LOG_ODDS))


def directions(vectors: Floats) -> Floats:
    """Return vectors (n, e) of length 1."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def learn_appearance(detections: Detections) -> tuple[Appearance | None, str]:
    """Learn what the vectors of boxes say; without an answer, return None and the reason.

    Boxes of one class are compared, or all where hardly an image has two of a class. The reason is
    empty if boxes have no vectors.
    """
    if not detections.embedding.shape[1]:
        return None, ""
    looks = directions(detections.embedding)
    images = [
        (looks[rows], detections.class_id[rows]) for _, rows in group_by_pose(detections.pose)
    ]
    lag = max(1, len(images) // PARTS)
    for by_class in (True, False):
        within = [_similarities(one, one, by_class=by_class) for one in images]
        different = np.concatenate([np.zeros(0), *(every for every, _ in within)])
        if len(different) >= MIN_PAIRS:
            break
    by_chance = np.concatenate([np.zeros(0), *(nearest for _, nearest in within)])
    later = [
        _similarities(one, other, by_class=by_class)[1]
        for one, other in zip(images, images[lag:], strict=False)
    ]
    same = np.concatenate([np.zeros(0), *later])
    if min(len(same), len(different)) < MIN_PAIRS:
        return None, (
            f"{len(same)} pairs of boxes in two images and {len(different)} in one are too few to "
            "learn what appearance vectors say: they are not used"
        )
    spread = max(_spread(same), _spread(different), LEAST_SPREAD)
    found = Appearance(float(np.median(same)), float(np.median(different)), spread)
    chance = float(np.median(by_chance))
    if found.same - chance < LEAST_DIFFERENCE * spread:
        return None, (
            "appearance vectors do not tell objects apart: the most similar boxes of two images "
            f"have a cosine of {found.same:.2f} in the median, those of one image {chance:.2f}; "
            "they are not used"
        )
    return found, ""


def _similarities(
    one: tuple[Floats, Ints], other: tuple[Floats, Ints], *, by_class: bool
) -> tuple[Floats, Floats]:
    """Compare the boxes of two images, or of one: looks (b, e) and classes (b,).

    Return the similarities of all pairs, and of those that are the most similar to each other.
    """
    similarity = one[0] @ other[0].T
    allowed = one[1][:, None] == other[1] if by_class else np.ones(similarity.shape, dtype=np.bool_)
    if one is other:
        allowed = allowed & ~np.eye(len(similarity), dtype=np.bool_)
    compared = np.where(allowed, similarity, -np.inf)
    best, back = compared.argmax(axis=1), compared.argmax(axis=0)
    rows = np.arange(len(compared))
    chosen = compared[rows, best]
    return similarity[allowed], chosen[(back[best] == rows) & np.isfinite(chosen)]


def _spread(values: Floats) -> float:
    """Return a standard deviation that outliers hardly change."""
    return SIGMA_OF_MAD * float(np.median(np.abs(values - np.median(values))))
