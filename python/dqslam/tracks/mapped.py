"""Objects of a map that move: their boxes fit a place at rest, but not a thing of their class.

What moves along a straight line while the camera does looks like a thing at rest, of another size
at another distance, and off the ground. Size and ground tell.
"""

from __future__ import annotations

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._ids import ObjectRow
from dqslam.assumptions import BoxNoise, SizePrior, SizePriors
from dqslam.recording import Recording
from dqslam.tracks.candidates import FEWEST_IMAGES, Scene, make_scene, one_an_image, thinned
from dqslam.tracks.judge import Judgment, judge
from dqslam.tracks.reckoned import PathCovariance

# Movers in the map show a wrong ground: all are judged again without those that were found.
_ROUNDS = 3
# What rests with a higher probability is not judged again.
SURELY_RESTS = 0.9999


def find_moving(
    recording: Recording,
    poses: Floats,
    ellipsoids: Floats,
    object_rows: Ints,
    *,
    box_noise: BoxNoise,
    size_prior: SizePrior | SizePriors | None = None,
    path_covariance: PathCovariance = lambda images: None,
) -> dict[ObjectRow, str]:
    """Return objects of a map that move, and why that is believed; of classes of known size only.

    The path and its covariance should not follow from the objects that are judged: a map that has
    a mover at rest has a path that makes it rest, and believes it.

    Parameters
    ----------
    poses, ellipsoids
        Shapes (n, d) and (o, 9).
    object_rows
        Row of the ellipsoid that each box shows, -1 for none, shape (m,).
    size_prior
        Sizes that were told by class; those of traffic are known.
    path_covariance
        By default the path is exact.
    """
    shown = np.unique(object_rows[object_rows >= 0])
    boxes = {row: np.flatnonzero(object_rows == row) for row in shown.tolist()}
    candidates = list(boxes)
    moving = dict[ObjectRow, str]()
    judged: dict[int, Judgment] = {}
    for _ in range(_ROUNDS):
        resting = shown[~np.isin(shown, list(moving))]
        at_rest = np.where(np.isin(object_rows, resting), object_rows, -1)
        scene = make_scene(recording, poses, ellipsoids, at_rest, box_noise, size_prior)
        for row in candidates:
            one = _judge(scene, boxes[row], path_covariance)
            if one is not None:
                judged[row] = one
        before = moving
        moving = {
            ObjectRow(row): _reason(scene.class_name(boxes[row]), one)
            for row, one in judged.items()
            if one.is_mover
        }
        if moving.keys() == before.keys():
            break
        candidates = [row for row, one in judged.items() if one.probability["rests"] < SURELY_RESTS]
    return moving


def _judge(scene: Scene, rows: Ints, path_covariance: PathCovariance) -> Judgment | None:
    """Judge what some boxes (b,) show; None where that cannot be done."""
    rows = thinned(one_an_image(scene.recording, rows))
    class_name = scene.class_name(rows)
    size = scene.size(class_name)
    if size is None or scene.whole_heights(rows) < FEWEST_IMAGES:
        return None
    path = path_covariance(scene.recording.detections.pose[rows])
    return judge(scene.problem(rows, size, class_name), path)


def _reason(class_name: str, judged: Judgment) -> str:
    return (
        f"as a {class_name} on the ground it {judged.behavior}, with a probability of "
        f"{1.0 - judged.probability['rests']:.4g}"
    )
