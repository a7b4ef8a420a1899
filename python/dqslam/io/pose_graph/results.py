"""The pose graph of a directory of results."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.assumptions import BoxNoise, OdometryNoise
from dqslam.io.files import FileError
from dqslam.io.pose_graph.boxes import positions_of_boxes
from dqslam.io.pose_graph.graph import LandmarkEdges, PoseGraph
from dqslam.io.results import Results
from dqslam.io.step_covariances import read_step_covariances


def pose_graph_of_results(
    results: Results, odometry_covariance: str | Path | None = None
) -> PoseGraph:
    """Return the camera's poses as estimated, the steps of the odometry, and the objects.

    Steps are those of ``odometry.txt``. Their covariance is that of a file as
    ``--odometry-covariance`` reads it, or that of every step by ``report.json``. Boxes that fit,
    with four edges in the image, are positions of their objects, with the shapes as estimated.

    Raises
    ------
    FileError
        If neither a file nor the report says how accurate the odometry is, or if one is wrong.
    """
    model, path = _core.PoseModel.SE3, results.initial_poses
    steps = np.arange(len(path) - 1)
    objects = results.objects
    return PoseGraph(
        pose_model=model,
        poses=results.poses,
        from_pose=steps,
        to_pose=steps + 1,
        relative=_core.between(model, path[:-1], path[1:]),
        covariance=_step_covariances(results, odometry_covariance),
        landmark_ids=objects.object_ids,
        landmarks=objects.centers,
        landmark_edges=_landmark_edges(results),
    )


def _step_covariances(results: Results, file: str | Path | None) -> Floats:
    if file is not None:
        return read_step_covariances(file, results.timestamps)
    report, name = results.report, results.directory / "report.json"
    for key in ("odometry_noise", "odometry_noise_believed"):
        noise = report.get(key)
        if isinstance(noise, dict) and "translation_m" in noise:
            try:
                values = float(noise["translation_m"]), float(noise["rotation_rad"])
                return OdometryNoise(*values).covariance(len(results.poses) - 1)
            except (KeyError, TypeError, ValueError) as error:
                raise FileError(name, f"{key}: {error}") from None
    given = report.get("odometry_covariance")
    if given is not None:
        raise FileError(name, f"the odometry has the covariances of {given}: name that file")
    raise FileError(name, "does not say how accurate the odometry is: name a file of covariances")


def _landmark_edges(results: Results) -> LandmarkEdges:
    boxes, objects = results.boxes, results.objects
    if boxes is None or not len(boxes) or not len(objects):
        none = np.zeros(0, dtype=np.int64)
        return LandmarkEdges(none, none, np.zeros((0, 3)), np.zeros((0, 3, 3)))
    given = results.report.get("box_noise", {})
    try:
        noise = BoxNoise(**{str(key): float(value) for key, value in given.items()})
        covariance = noise.covariance(boxes.box, results.camera)
    except (AttributeError, TypeError, ValueError) as error:
        raise FileError(results.directory / "report.json", f"box_noise: {error}") from None
    row_of = {int(number): row for row, number in enumerate(objects.object_ids)}
    landmark = np.array([row_of.get(int(number), -1) for number in boxes.object_id])
    return positions_of_boxes(
        _core.PoseModel.SE3,
        results.camera,
        results.poses,
        objects.ellipsoids,
        pose=boxes.pose,
        landmark=landmark,
        box=boxes.box,
        covariance=covariance,
        used=(landmark >= 0) & boxes.inlier & ~boxes.truncated.any(axis=1),
    )
