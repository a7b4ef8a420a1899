"""Final ids: a last round of association, from an estimate that has all of their boxes.

Along a drifting path a box that is right may be refused. The map then agrees with itself without
it, the path bent where it is missing, and round after round refuses it again. Final ids say which
object a box shows: all are believed once, under a robust loss, and judged from what comes of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam.associate import Association
from dqslam.associate.births import FEWEST_VIEWS
from dqslam.associate.judge import find_misfits, find_movers, find_scattered
from dqslam.associate.refine import reassign, settle
from dqslam.associate.scene_map import SceneMap


def judge_again(found: Association) -> Association:
    """Return what is found once all boxes of the final ids in a map have been tried together.

    The map changes; objects that were left out take part in the trial, and may come back.
    """
    scene = found.scene
    number_of = {name: row for row, name in enumerate(found.ids.tolist()) if name >= 0}
    if not number_of:
        return found
    claims = scene.recording.detections.object_id.tolist()
    number = np.array([number_of.get(name, -1) for name in claims], dtype=np.int64)
    refused = np.flatnonzero(scene.box_object < 0)
    scene.claim(refused, number[refused])
    scene.left_out = {}
    settle(scene)
    reassign(scene, np.inf)
    scene.left_out = _find_few(scene)
    scene.left_out |= find_misfits(scene)
    scene.left_out |= find_movers(scene)
    scene.left_out |= find_scattered(scene)
    settle(scene)
    left_out = {name: why for name, why in found.left_out.items() if name not in number_of}
    left_out |= {
        name: scene.left_out[row] for name, row in number_of.items() if row in scene.left_out
    }
    return replace(found, left_out=dict(sorted(left_out.items())))


def _find_few(scene: SceneMap) -> dict[int, str]:
    """Return objects that too few boxes are left of."""
    counts = scene.box_counts
    return {
        row: f"one place explains {counts[row]} of its boxes, {FEWEST_VIEWS} are needed"
        for row in np.flatnonzero(counts < FEWEST_VIEWS).tolist()
    }
