"""Colors of figures and pages: of paths, of classes and of objects, the same everywhere."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from dqslam._checks import Floats

# Color-blind readers can distinguish these (Okabe and Ito).
BLUE, ORANGE, GREEN, VERMILLION = "#0072B2", "#E69F00", "#009E73", "#D55E00"
SKY, PURPLE, YELLOW, GRAY = "#56B4E9", "#CC79A7", "#F0E442", "#808080"
# The paths have the paper's colors.
ODOMETRY, TRUTH, ESTIMATE = BLUE, GREEN, VERMILLION
# Of the first classes: no path has them. The last four are from Tol's palette.
FIRST = (ORANGE, SKY, PURPLE, "#882255", "#999933", "#332288", "#AA4499")

# Further colors are chosen among these: neither pale nor black, on white and on dark ground.
_LIGHTNESS = (0.45, 0.6, 0.75)
_CHROMA = (0.07, 0.13)


def class_colors(names: Iterable[str], *others: Iterable[str]) -> dict[str, str]:
    """Return the color of each class, ``#rrggbb``: of a map, in the order of names, then others.

    No two classes share one. The same names have the same colors in every figure and viewer.
    """
    ordered = sorted(set(names))
    for more in others:
        ordered += sorted(set(more) - set(ordered))
    return dict(zip(ordered, _distinct(len(ordered)), strict=True))


def object_colors(class_names: Sequence[str], of_class: dict[str, str] | None = None) -> list[str]:
    """Return the color of each object: that of its class, or its own if there is only one class."""
    if is_colored_by_object(class_names):
        return _distinct(len(class_names))
    colors = class_colors(class_names) if of_class is None else of_class
    return [colors[name] for name in class_names]


def moving_colors(
    class_names: Sequence[str], moving: Iterable[str], of_class: dict[str, str]
) -> dict[str, str]:
    """Return the color of each class of what moves, beside a map of objects of some classes.

    It is that of the class or, if colors tell the objects apart, one that no object has.
    """
    names = sorted(set(moving))
    if not names or not is_colored_by_object(class_names):
        return {name: of_class[name] for name in names}
    count = len(class_names)
    return dict(zip(names, _distinct(count + len(names))[count:], strict=True))


def is_colored_by_object(class_names: Sequence[str]) -> bool:
    """Return whether colors tell objects apart, because all are of one class."""
    return len(set(class_names)) == 1


def ink_on(color: str) -> str:
    """Return black or white, whichever is easier to read on a color."""
    red, green, blue = (_linear(value / 255) for value in bytes.fromhex(color[1:]))
    # Relative luminance; both have the same contrast to a gray of 0.179.
    return "black" if 0.2126 * red + 0.7152 * green + 0.0722 * blue > 0.179 else "white"


def _distinct(count: int) -> list[str]:
    """Return so many colors, each as far as possible from those before it and from the paths'."""
    chosen = list(FIRST[:count])
    if count <= len(FIRST):
        return chosen
    candidates = _candidates(hues=max(36, count))
    taken = np.stack([_oklab(one) for one in (*FIRST, ODOMETRY, TRUTH, ESTIMATE, GRAY)])
    nearest = np.linalg.norm(candidates[:, None] - taken, axis=2).min(axis=1)
    while len(chosen) < count:
        best = int(nearest.argmax())
        chosen.append(_hex(candidates[best]))
        nearest = np.minimum(nearest, np.linalg.norm(candidates - candidates[best], axis=1))
    return chosen


def _candidates(hues: int) -> Floats:
    """Return colors that screens can show, as OKLab, shape (k, 3)."""
    angle = np.linspace(0, 2 * np.pi, hues, endpoint=False)
    every = [
        np.stack([np.full(hues, light), chroma * np.cos(angle), chroma * np.sin(angle)], axis=1)
        for light in _LIGHTNESS
        for chroma in _CHROMA
    ]
    colors: Floats = np.concatenate(every)
    linear = _rgb(colors)
    return colors[((linear >= 0) & (linear <= 1)).all(axis=1)]


# OKLab, in which equal distances look equal (Ottosson 2020).
_LMS = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def _oklab(color: str) -> Floats:
    linear = np.array([_linear(value / 255) for value in bytes.fromhex(color[1:])])
    return np.asarray(_LAB @ np.cbrt(_LMS @ linear))


def _rgb(oklab: Floats) -> Floats:
    """Return linear red, green and blue (k, 3) of OKLab (k, 3)."""
    cubes = (oklab @ np.linalg.inv(_LAB).T) ** 3
    return np.asarray(cubes @ np.linalg.inv(_LMS).T)


def _hex(oklab: Floats) -> str:
    linear = _rgb(oklab[None])[0].clip(0.0, 1.0)
    curved = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return "#" + bytes(np.rint(255 * curved).astype(np.uint8)).hex().upper()


def _linear(share: float) -> float:
    return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4
