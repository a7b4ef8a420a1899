"""Whether depth images and a map agree about distances: a wrong scale is named, not fused."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Floats
from dqslam.surface.body import Body
from dqslam.surface.views import View

# Scales of depth images that are in use: TUM, millimeters, RealSense, ScanNet, meters.
USUAL = (1.0, 100.0, 256.0, 1000.0, 4000.0, 5000.0, 10000.0)
# Depth may differ from the map by this factor: bodies are rough, and things hide each other.
MOST = 1.5
# A usual scale is named if it is so near to what the depth says.
_NEAR = 1.25
_RAYS = 9  # along each side of the square within a body's outline


def depth_ratio(view: View, body: Body) -> float:
    """Return the depth of an image where it shows an object, over that in the map; NaN if unseen.

    It compares the median over rays through the middle of the body with the depth of its front.
    """
    center = view.to_camera(body.center)
    turn = view.world_from_camera.T @ body.world_from_object
    front = float(center[2]) - float(np.linalg.norm(turn[2] * body.semi_axes))
    if front <= 0.0:
        return float("nan")
    camera, reach = view.camera, 0.5 * float(body.semi_axes.min())
    steps = np.linspace(-reach, reach, _RAYS)
    u = np.rint((camera.fx * (center[0] + steps)) / center[2] + camera.cx).astype(int)
    v = np.rint((camera.fy * (center[1] + steps)) / center[2] + camera.cy).astype(int)
    u, v = u[(u >= 0) & (u < camera.width)], v[(v >= 0) & (v < camera.height)]
    depth = view.depth[np.ix_(v, u)]
    depth = depth[depth > 0.0]
    return float(np.median(depth)) / front if depth.size else float("nan")


def check_scale(name: str, scale: float | None, ratios: Floats) -> None:
    """Refuse depth that contradicts a map.

    Parameters
    ----------
    name
        What the error calls the images.
    scale
        The scale with which they were read; None if they are in meters already.
    ratios
        What ``depth_ratio`` says of images and objects, NaN among them, shape (k,).

    Raises
    ------
    ValueError
        If no image has depth where the map has an object, or the median ratio is off by more than
        ``MOST``; the error names the scale that would fit.
    """
    known = ratios[np.isfinite(ratios)]
    if not known.size:
        raise ValueError(f"{name}: no image has any depth where the map has an object")
    ratio = float(np.median(known))
    if 1.0 / MOST <= ratio <= MOST:
        return
    message = f"{name}: depth is {ratio:.3g} times the distances of the map"
    if scale is None:
        raise ValueError(f"{message}: are both in meters?")
    fits = scale * ratio
    usual = min(USUAL, key=lambda one: abs(np.log(one / fits)))
    if max(usual / fits, fits / usual) <= _NEAR:
        fits = usual
    raise ValueError(
        f"{message}: --depth-scale {scale:g} seems wrong, {fits:.4g} would fit; or the map is not "
        "in meters"
    )
