"""Problems of the core with a part of the poses."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core
from dqslam.subgraph import rebuilt, select_poses

ORBIT = dq.load_scenario("orbit")
OPTIONS = _core.SolveOptions(
    schedule=_core.Schedule.BATCH, residual=_core.Residual.BOX, loss=_core.Loss.NONE
)


def sparse_orbit():
    """Return a problem with boxes in every fourth image, its truth, and these images."""
    path = ORBIT.path.model_copy(update={"turns": 0.5, "poses": 41})
    recording, truth = dq.simulate(ORBIT.model_copy(update={"path": path}), seed=3)
    boxes = recording.detections
    boxes = boxes.select(boxes.pose % 4 == 0)
    graph = dq.build_graph(replace(recording, positions=None, detections=boxes))
    return graph, truth, np.unique(boxes.pose)


def test_poses_without_boxes_change_nothing_but_time():
    graph, truth, images = sparse_orbit()
    start = _core.State(truth.poses, truth.ellipsoids[graph.object_ids])
    whole = _core.solve(graph.core, OPTIONS, start)
    thin = select_poses(graph.core, images)
    assert thin.num_poses == len(images) < graph.core.num_poses
    part = _core.solve(thin, OPTIONS, _core.State(start.poses[images], start.landmarks))
    assert part.summary.final_cost == pytest.approx(whole.summary.final_cost, rel=3e-3)
    np.testing.assert_allclose(part.poses[:, :3], whole.poses[images, :3], atol=1e-3)
    np.testing.assert_allclose(part.landmarks[:, :3], whole.landmarks[:, :3], atol=1e-3)


def test_odometry_is_composed():
    graph, _, _ = sparse_orbit()
    core = graph.core
    kept = np.array([one for one in range(41) if one % 4 == 0 or one == 38])
    thin = select_poses(core, kept).odometry
    path = _core.dead_reckon(core.pose_model, core.initial_poses[0], core.odometry.relative)
    expected = _core.between(core.pose_model, path[kept[:-1]], path[kept[1:]])
    np.testing.assert_allclose(thin.relative, expected, atol=1e-12)
    # Rotations add up: four steps have twice the variance of two.
    turns = thin.covariance.reshape(-1, 6, 6)[:, 3:, 3:].trace(axis1=1, axis2=2)
    assert turns[0] == pytest.approx(2 * turns[-1], rel=1e-9)


def test_with_loop_closures_all_poses_stay():
    graph, _, images = sparse_orbit()
    steps = graph.core.odometry
    closed = _core.OdometryTable(
        from_pose=np.append(steps.from_pose, 0),
        to_pose=np.append(steps.to_pose, 40),
        relative=np.concatenate([steps.relative, steps.relative[:1]]),
        covariance=np.concatenate([steps.covariance, steps.covariance[:1]]),
    )
    core = rebuilt(graph.core, odometry=closed)
    assert select_poses(core, images) is core
