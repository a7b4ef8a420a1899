"""How large the things are that move by themselves: what tells a car at rest from one that comes.

What moves along a straight line while the camera does looks like a thing at rest, at another
distance and hence of another size. Only its true size tells.
"""

import tomllib
from functools import cache
from pathlib import Path

import numpy as np

# An ellipsoid that explains the boxes of a box-shaped object is larger than the one inscribed:
# by 4/pi where it is seen from around, by 1 in height.
SWELLING = float((4.0 / np.pi) ** (2.0 / 3.0))


def usual_size(class_name: str) -> float | None:
    """Return the mean logarithm of the semi-axes [log m] of what moves by itself; None for others.

    Of the ellipsoids that explain its boxes.
    """
    return _table().get(class_name.lower())


@cache
def _table() -> dict[str, float]:
    here = Path(__file__).resolve()
    # In the installed package, or in a checkout.
    roots = (here.parents[1], here.parents[3])
    places = [root / "data" / "sizes" / "traffic.toml" for root in roots]
    file = next(place for place in places if place.is_file())
    sizes = tomllib.loads(file.read_text(encoding="utf-8"))["size_m"]
    return {
        name: float(np.log(SWELLING * np.array(size) / 2).mean()) for name, size in sizes.items()
    }
