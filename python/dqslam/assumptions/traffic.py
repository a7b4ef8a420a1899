"""The usual sizes of things that move by themselves, which help to recognize a moving car.

An object that moves along a straight line, while the camera does too, looks like an object at rest
at another distance, and hence of another size. Only its true size shows the difference.
"""

import tomllib
from functools import cache
from pathlib import Path

import numpy as np

from dqslam._checks import Floats

# An ellipsoid that explains the boxes of a box-shaped object is larger than the inscribed one: by a
# factor of 4/pi horizontally, if it is seen from all around, but not in height.
SWELLING = float((4.0 / np.pi) ** (2.0 / 3.0))


def usual_size(class_name: str) -> float | None:
    """Return the mean logarithm of the semi-axes [log m] of a moving class; None for other classes.

    The semi-axes are those of the ellipsoids that explain the boxes of the class.
    """
    sides = usual_sides(class_name)
    return None if sides is None else float(np.log(SWELLING * sides / 2).mean())


def usual_sides(class_name: str) -> Floats | None:
    """Return length, width and height [m] of a moving class, shape (3,); None for other classes."""
    return _table().get(class_name.lower())


@cache
def _table() -> dict[str, Floats]:
    here = Path(__file__).resolve()
    # The file is in the installed package or in a checkout.
    roots = (here.parents[1], here.parents[3])
    places = [root / "data" / "sizes" / "traffic.toml" for root in roots]
    file = next(place for place in places if place.is_file())
    sizes = tomllib.loads(file.read_text(encoding="utf-8"))["size_m"]
    return {name: np.array(size, dtype=np.float64) for name, size in sizes.items()}
