"""Write an estimate into a directory."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, require
from dqslam._outputs import output_set
from dqslam.estimate import Estimate
from dqslam.io.camera.table import write_json_camera
from dqslam.io.files import write_json, write_text
from dqslam.io.results.boxes import write_boxes
from dqslam.io.results.covariances import write_covariances
from dqslam.io.results.graph_file import GRAPH_FILE, Problem, write_graph
from dqslam.io.results.tracks import describe, write_tracks
from dqslam.io.trajectory import write_trajectory
from dqslam.recording import Detections

NO_POSES = "# no poses\n"
"""The content of ``trajectory.txt`` and ``odometry.txt`` of an estimate without poses."""


class Covariances(Protocol):
    """The covariances of poses and mapped objects, as in ``uncertainty.Marginals``."""

    @property
    def poses(self) -> Floats:
        """Covariance of each pose in its own frame [m, rad], shape (n, k, k); NaN for none."""

    @property
    def objects(self) -> Floats:
        """Covariance of center [m] and log-Cholesky shape, shape (o, 9, 9); NaN for none."""


def save_estimate(
    estimate: Estimate,
    directory: str | Path,
    *,
    detections: Detections | None = None,
    held_out: Bools | None = None,
    marginals: Covariances | None = None,
    graph: Problem | None = None,
    options: _core.SolveOptions | None = None,
) -> None:
    """Write an estimate into a directory, which is created if needed.

    ``trajectory.txt`` has the estimated poses and ``odometry.txt`` the initial poses, both
    world_from_camera. ``map.json`` has the objects, and the reasons why others were dropped.
    ``camera.json`` has the camera. ``manifest.json`` has the SHA-256 of each file. The files of an
    earlier call go at once when those of this one are there. If the directory has files of others,
    they stay, and the files are exchanged one by one.

    Parameters
    ----------
    detections
        Boxes for ``boxes.csv``. They are the boxes that the estimator used, in the order of
        ``estimate.inliers``. Between them may be others, which were held out or have object -1.
    held_out
        Whether each box was held out from the estimator, shape (m,); by default none was.
    marginals
        Covariances of the poses, for ``covariance.csv``, and of the objects, which need the
        ellipsoid model.
    graph, options
        The problem that was solved, and the options of the solver, for ``graph.npz``. ``merge``
        solves the problems of several such directories as one.

    Raises
    ------
    ValueError
        If detections or marginals do not fit the estimate.
    FileError
        If the directory has the results of a command, or files of these names that are others' or
        have been changed since an earlier call, or if a file cannot be written.

    Examples
    --------
    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> graph = dq.build_graph(recording)
    >>> estimate, summary = dq.solve(graph)
    >>> marginals = dq.marginal_covariances(graph, estimate)
    >>> dq.save_estimate(estimate, "results/seed7", marginals=marginals)
    >>> dq.load_results("results/seed7")
    Results('results/seed7', 253 poses, 10 objects)
    """
    require(estimate, Estimate, "save_estimate", "save_estimate(estimate, directory)")
    with output_set(directory, "save_estimate", beside_others=True) as folder:
        write_estimate(estimate, folder, detections, held_out, marginals)
        if graph is not None:
            solved_with = _core.SolveOptions() if options is None else options
            write_graph(folder / GRAPH_FILE, graph, estimate, solved_with)


def write_estimate(
    estimate: Estimate,
    directory: Path,
    detections: Detections | None = None,
    held_out: Bools | None = None,
    marginals: Covariances | None = None,
) -> None:
    """Write the files of an estimate into a folder that has none of them; see `save_estimate`."""
    paths = {"trajectory.txt": estimate.poses, "odometry.txt": estimate.initial_poses}
    for name, poses in paths.items():
        cameras = _core.world_from_camera(estimate.pose_model, estimate.camera, poses)
        if len(poses):
            write_trajectory(directory / name, estimate.timestamps, cameras)
        else:
            write_text(directory / name, NO_POSES)
    write_json_camera(directory / "camera.json", estimate.camera)
    objects = [_object(estimate, row, marginals) for row in range(len(estimate.object_ids))]
    dropped = [{"id": number, "reason": reason} for number, reason in estimate.dropped.items()]
    content: dict[str, Any] = {"objects": objects, "dropped": dropped}
    if estimate.tracks:
        content["tracks"] = [describe(track, estimate.timestamps) for track in estimate.tracks]
        write_tracks(directory / "tracks.csv", estimate.tracks, estimate.timestamps)
    write_json(directory / "map.json", content)
    if detections is not None:
        write_boxes(directory / "boxes.csv", estimate, detections, held_out)
    if marginals is not None:
        write_covariances(directory / "covariance.csv", estimate, marginals.poses)


def _shape_of(estimate: Estimate, row: int) -> str:
    shapes = estimate.object_shapes
    return (shapes[row] if shapes else _core.Shape.ELLIPSOID).name.lower()


def _object(estimate: Estimate, row: int, marginals: Covariances | None) -> dict[str, Any]:
    """Describe one object; shape and axes are null if its dual quadric is no ellipsoid."""
    semi_axes, orientation = None, None
    if estimate.is_ellipsoid[row]:
        _, semi_axes, orientation = _core.axes_from_ellipsoid(estimate.ellipsoids[row])
    described = {
        "id": int(estimate.object_ids[row]),
        "class_name": estimate.class_names[row],
        "shape": None if semi_axes is None else _shape_of(estimate, row),
        "center": estimate.centers[row],
        "semi_axes": semi_axes,
        "orientation_xyzw": orientation,
        "dual_quadric": _core.dual_quadric_matrix(estimate.dual_quadrics[row]),
        "observations": int(estimate.observations[row]),
    }
    if estimate.is_body[row]:
        described |= {
            "half_lengths": estimate.half_lengths[row],
            "rotation_vector": estimate.landmarks[row, 6:9],
        }
    doubt = estimate.doubtful.get(int(estimate.object_ids[row]))
    if doubt is not None:
        described["doubt"] = doubt
    if int(estimate.object_ids[row]) in estimate.contradicted:
        described["contradicted"] = estimate.contradicted[int(estimate.object_ids[row])]
    covariance = None if marginals is None else marginals.objects[row]
    if covariance is None or semi_axes is None or not np.isfinite(covariance).all():
        return described
    described |= {
        "center_covariance": covariance[:3, :3],
        "log_semi_axes_sigma": np.sqrt(estimate.log_semi_axes_variances(row, covariance)),
    }
    if estimate.is_body[row]:
        described["log_half_lengths_sigma"] = np.sqrt(np.diagonal(covariance)[3:6])
    return described
