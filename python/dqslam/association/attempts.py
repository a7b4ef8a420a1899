"""More than one attempt at a map, where the first refuses many boxes.

A gate that is too narrow refuses the boxes that would show it, and a map of the few that are left
agrees with itself. So a map that does not explain enough boxes is made again, with ids that are
final all believed from the start, then with noise that is larger, and the map that explains the
most boxes is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Ints
from dqslam.association.follow import Follower
from dqslam.association.gating import GATE
from dqslam.association.initiation import MIN_VIEWS
from dqslam.association.refine import refine
from dqslam.association.scene_map import SceneMap

# Final ids are believed from the start unless a map explains this share of the boxes that might
# show an object: it is quick, and a map without some of its objects may be wrong ...
ENOUGH_OF_IDS = 0.95
# ... and noise is raised unless it explains this share: boxes may show what moves, or nothing.
ENOUGH_EXPLAINED = 0.5
# Another attempt is better if it explains so many times as many boxes, and enough: fewer are
# chance, for noise that is large bends the path to any boxes.
BETTER = 1.05
# Sigmas of the odometry's noise begin so much larger in the last attempt.
RAISED = 3.0

MakeScene = Callable[[float], SceneMap]
"""Return a map without objects; sigmas of the noise begin so many times larger."""


@dataclass(frozen=True)
class Attempt:
    """A map, and what made it."""

    scene: SceneMap
    follower: Follower

    @property
    def explained(self) -> int:
        """Boxes that fit an object that takes part."""
        scene = self.scene
        rows = np.flatnonzero(scene.labels.takes_part[scene.labels.object_rows])
        chi2 = scene.chi2(rows, scene.ellipsoids[scene.labels.object_rows[rows]])
        return int(np.sum(chi2 <= GATE[4]))


def make_map(
    make_scene: MakeScene, trust: float, progress: Callable[[float], None]
) -> tuple[Attempt, list[str]]:
    """Make a map, again if need be; return the best one, and sentences on what was done."""
    first = make_scene(1.0)
    possible = int(np.sum(np.isin(first.labels.tracklets, long_tracklets(first))))
    follower = Follower(trust=trust)
    follower.follow(first, lambda share: progress(0.7 * share))
    refine(first, follower, lambda share: progress(0.7 + 0.2 * share))
    best = Attempt(first, follower)
    remarks = []
    raises = first.step_noise is not None
    for how, enough, raised, grown in (
        ("with all ids believed from the start", ENOUGH_OF_IDS, 1.0, True),
        ("with all ids believed and the noise raised", ENOUGH_EXPLAINED, RAISED, True),
        ("with the noise of the odometry raised", ENOUGH_EXPLAINED, RAISED, False),
    ):
        if best.explained >= enough * possible:
            break
        if (raised > 1.0 and not raises) or (grown and not follower.final):
            continue
        other = _attempt(make_scene(raised), trust, grown=grown)
        if other is None:
            continue
        is_better = other.explained > max(BETTER * best.explained, ENOUGH_EXPLAINED * possible)
        remarks.append(
            f"the map explained {best.explained} of {possible} boxes; made again {how} it "
            f"explains {other.explained}" + (", and is used" if is_better else ", and is not used")
        )
        best = other if is_better else best
    return best, remarks


def _attempt(scene: SceneMap, trust: float, *, grown: bool) -> Attempt | None:
    follower = Follower(trust=trust)
    if not grown:
        follower.follow(scene, lambda share: None)
    elif not grow_together(scene):
        return None
    refine(scene, follower)
    return Attempt(scene, follower)


def long_tracklets(scene: SceneMap) -> Ints:
    """Return the tracklets that have views enough for an object."""
    pairs = np.column_stack([scene.labels.tracklets, scene.recording.detections.pose])
    views = np.bincount(np.unique(pairs, axis=0)[:, 0]) if len(pairs) else np.zeros(0, dtype=int)
    return np.flatnonzero(views >= MIN_VIEWS)


def grow_together(scene: SceneMap) -> bool:
    """Let the solver grow a map of all tracklets at once, each an object; return whether it could.

    Its robust loss forgives boxes that show something else, and no gate refuses any.
    """
    labels = scene.labels
    scene.extend(len(scene.recording.timestamps))
    for tracklet in long_tracklets(scene).tolist():
        scene.add_object(np.zeros(9), np.flatnonzero(labels.tracklets == tracklet))
    graph = scene.graph()
    if graph is None:
        return False
    options = _core.SolveOptions(mode=scene.mode, loss=_core.Loss.CAUCHY, loss_scale=2.0)
    solution = _core.solve(graph.core, options)
    scene.poses, scene.ellipsoids[graph.object_ids] = solution.poses, solution.landmarks
    return True
