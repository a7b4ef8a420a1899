"""How large objects of well-known classes are, which tells the unit of the positions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

# The geometric mean of what a box shows of width and height, roughly [m]: everyday classes of COCO.
USUAL_M = {
    "backpack": 0.4,
    "bed": 1.3,
    "bench": 1.0,
    "bicycle": 1.1,
    "book": 0.17,
    "bottle": 0.14,
    "bowl": 0.13,
    "bus": 4.0,
    "car": 2.2,
    "cell phone": 0.1,
    "chair": 0.65,
    "clock": 0.25,
    "couch": 1.2,
    "cup": 0.09,
    "dining table": 1.1,
    "handbag": 0.3,
    "keyboard": 0.22,
    "laptop": 0.28,
    "microwave": 0.4,
    "motorcycle": 1.2,
    "mouse": 0.07,
    "oven": 0.7,
    "person": 0.9,
    "potted plant": 0.4,
    "refrigerator": 1.1,
    "remote": 0.1,
    "scissors": 0.12,
    "sink": 0.4,
    "suitcase": 0.55,
    "teddy bear": 0.3,
    "toilet": 0.55,
    "truck": 3.5,
    "tv": 0.6,
    "vase": 0.2,
}
# Toys and wrong names are of one class or two: fewer classes tell nothing. Sizes within a class
# differ by half; a unit changes all of them by the same factor, of three and more.
FEWEST_CLASSES = 3
LEAST_FACTOR, MOST_SPREAD = 2.5, 0.7


def size_factor(sizes: Mapping[str, float]) -> float | None:
    """Return by how much all objects are larger than usual, None unless by far, and alike.

    ``sizes`` has the size of each class [m], by its name.
    """
    ratios = [np.log(size / USUAL_M[name]) for name, size in sizes.items() if name in USUAL_M]
    if len(ratios) < FEWEST_CLASSES or float(np.std(ratios)) > MOST_SPREAD:
        return None
    middle = float(np.median(ratios))
    return float(np.exp(middle)) if abs(middle) >= np.log(LEAST_FACTOR) else None
