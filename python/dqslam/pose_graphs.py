"""The pose graph of a problem and its estimate, for programs that know no boxes."""

from __future__ import annotations

import numpy as np

from dqslam._checks import require
from dqslam.estimate import Estimate
from dqslam.graph import Graph
from dqslam.io import LandmarkEdges, PoseGraph, positions_of_boxes


def pose_graph(graph: Graph, estimate: Estimate) -> PoseGraph:
    """Return poses and objects as estimated, with odometry, measured positions and boxes as edges.

    Boxes become positions of their objects, with the shapes as estimated, if they fit and all four
    edges were measured. Measurements of other kinds and priors are left out.

    Examples
    --------
    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> graph = dq.build_graph(recording)
    >>> estimate, summary = dq.solve(graph)
    >>> found = dq.pose_graph(graph, estimate)
    >>> found
    PoseGraph(SE2, 253 poses, 252 edges, 10 landmarks)
    >>> dq.io.write_g2o("drive.g2o", found)
    """
    require(graph, Graph, "pose_graph", "call build_graph(recording) first")
    require(estimate, Estimate, "pose_graph", "estimate, summary = solve(graph)")
    core, model = graph.core, graph.core.pose_model
    odometry, boxes = core.odometry, core.boxes
    box_pose = boxes.pose.astype(np.int64)
    k = int(np.sqrt(odometry.covariance.shape[1]))
    # Rows of the estimate's objects, -1 for those that it has dropped.
    row = np.full(len(graph.object_ids), -1)
    kept = np.isin(graph.object_ids, estimate.object_ids)
    row[kept] = np.arange(kept.sum())
    of_boxes = positions_of_boxes(
        model,
        core.camera,
        estimate.poses,
        estimate.ellipsoids,
        pose=box_pose,
        landmark=row[boxes.object],
        box=boxes.box,
        covariance=boxes.covariance.reshape(-1, 4, 4),
        used=(row[boxes.object] >= 0) & estimate.inliers & ~boxes.truncated.any(axis=1),
    )
    tables = [of_boxes]
    for table in core.measurements:
        if table.kind == "position":
            seen = row[table.object] >= 0
            tables.append(
                LandmarkEdges(
                    table.pose[seen].astype(np.int64),
                    row[table.object[seen]],
                    table.value[seen],
                    table.covariance[seen].reshape(-1, 3, 3),
                )
            )
    return PoseGraph(
        pose_model=model,
        poses=estimate.poses,
        from_pose=odometry.from_pose.astype(np.int64),
        to_pose=odometry.to_pose.astype(np.int64),
        relative=odometry.relative,
        covariance=odometry.covariance.reshape(-1, k, k),
        landmark_ids=estimate.object_ids,
        landmarks=estimate.centers,
        landmark_edges=LandmarkEdges(
            *(
                np.concatenate([getattr(one, name) for one in tables])
                for name in ("pose", "landmark", "position", "covariance")
            )
        ),
    )
