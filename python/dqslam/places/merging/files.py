"""Write a merged map as the files of a result, and ``merge.json``.

The trajectories follow one another in one file. Their times stay, unless they overlap with those of
a map before: then all times of a map are shifted, and ``merge.json`` says by how much.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam import _core
from dqslam._files import write_text
from dqslam.io.camera.table import named_values, write_json_camera
from dqslam.io.files import write_json
from dqslam.io.results import GRAPH_FILE, Results, write_graph
from dqslam.io.results.boxes import COLUMNS, EDGES
from dqslam.io.results.covariances import write_rows
from dqslam.io.trajectory import write_trajectory
from dqslam.places.alignment.result import describe_alignment
from dqslam.places.merging.joint import time_shift

if TYPE_CHECKING:
    from dqslam._checks import Floats
    from dqslam.places.landmarks import Landmarks
    from dqslam.places.merging.joining import MergedMap, Part

MERGE_FILE = "merge.json"


@dataclass(frozen=True, eq=False)
class _Drive:
    """A trajectory with its times in the merged files."""

    part: Part
    results: Results
    shift_s: float

    @property
    def times(self) -> Floats:
        return np.asarray(self.results.timestamps + self.shift_s)


def write_merged(merged: MergedMap, folder: Path) -> None:
    """Write all files of a merged map into an empty folder."""
    drives = _drives(merged)
    write_json(folder / "map.json", {"objects": _objects(merged.landmarks), "dropped": []})
    boxes_of: list[_Drive] = []
    if drives:
        times = np.concatenate([drive.times for drive in drives])
        for name, column in (("trajectory.txt", "poses"), ("odometry.txt", "initial_poses")):
            poses = np.concatenate([getattr(drive.part, column) for drive in drives])
            write_trajectory(folder / name, times, poses)
        write_json_camera(folder / "camera.json", drives[0].results.camera)
        covariances = np.concatenate([drive.part.pose_covariances for drive in drives])
        known = np.isfinite(covariances).all(axis=(1, 2))
        if known.any():
            write_rows(folder / "covariance.csv", times[known], covariances[known])
        camera = named_values(drives[0].results.camera)
        boxes_of = [
            drive
            for drive in drives
            if drive.results.boxes is not None and named_values(drive.results.camera) == camera
        ]
        if boxes_of:
            write_text(folder / "boxes.csv", _boxes(boxes_of))
    solved = merged.solved
    if solved is not None:
        write_graph(folder / GRAPH_FILE, solved.graph, solved.estimate, solved.options)
    write_json(folder / MERGE_FILE, _describe(merged, drives, boxes_of))


def _drives(merged: MergedMap) -> list[_Drive]:
    drives: list[_Drive] = []
    for part in merged.parts:
        results = part.results
        if results is None or not len(results.timestamps):
            continue
        begin = float(results.timestamps[0])
        shift = time_shift(float(drives[-1].times[-1]), begin) if drives else 0.0
        drives.append(_Drive(part, results, shift))
    return drives


def _objects(landmarks: Landmarks) -> list[dict[str, Any]]:
    objects = []
    for row in range(len(landmarks)):
        axes, turn = landmarks.semi_axes[row], landmarks.orientations[row]
        is_ellipsoid = bool(np.isfinite(axes).all() and np.isfinite(turn).all())
        described: dict[str, Any] = {
            "id": landmarks.object_ids[row],
            "class_name": landmarks.class_names[row],
            "center": landmarks.centers[row],
            "semi_axes": axes if is_ellipsoid else None,
            "orientation_xyzw": turn if is_ellipsoid else None,
            "dual_quadric": None,
            "observations": landmarks.observations[row],
            "center_covariance": landmarks.covariances[row],
        }
        if is_ellipsoid:
            ellipsoid = _core.ellipsoid_from_axes(landmarks.centers[row], axes, turn)
            quadric = _core.dual_quadric_from_ellipsoid(ellipsoid)
            described["dual_quadric"] = _core.dual_quadric_matrix(quadric)
        sigmas = landmarks.log_semi_axes_sigmas[row]
        if np.isfinite(sigmas).all():
            described["log_semi_axes_sigma"] = sigmas
        objects.append(described)
    return objects


def _boxes(drives: list[_Drive]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for drive in drives:
        boxes = drive.results.boxes
        assert boxes is not None
        ids = dict(zip(drive.part.object_ids.tolist(), drive.part.merged_ids.tolist(), strict=True))
        for row in range(len(boxes)):
            cut = (edge for edge, cut in zip(EDGES, boxes.truncated[row], strict=True) if cut)
            writer.writerow(
                [
                    repr(float(drive.times[boxes.pose[row]])),
                    *(f"{edge:.4f}" for edge in boxes.box[row]),
                    " ".join(cut),
                    f"{boxes.score[row]:g}",
                    int(boxes.class_id[row]),
                    boxes.class_name[row],
                    ids.get(int(boxes.object_id[row]), -1),
                    int(boxes.inlier[row]),
                    int(boxes.held_out[row]),
                ]
            )
    return text.getvalue()


def _describe(merged: MergedMap, drives: list[_Drive], boxes_of: list[_Drive]) -> dict[str, Any]:
    parts = []
    for part in merged.parts:
        drive = next((one for one in drives if one.part is part), None)
        alignment = part.alignment
        parts.append(
            {
                "map": part.name,
                "merged_from_map": part.merged_from_map,
                "covariance": part.covariance,
                "alignment": None
                if alignment is None
                else describe_alignment(alignment, "the maps before", part.name),
                "objects": [
                    {"id": own, "merged_id": new}
                    for own, new in zip(
                        part.object_ids.tolist(), part.merged_ids.tolist(), strict=True
                    )
                ],
                "poses": 0 if drive is None else len(drive.times),
                "time_shift_s": None if drive is None else drive.shift_s,
                "boxes_kept": drive in boxes_of,
                "why_fused": part.why_fused,
            }
        )
    return {
        "method": "all recordings solved as one problem"
        if merged.solved is not None
        else "maps fused by their covariances, see why_fused of each; their trajectories are moved "
        "as they are",
        "parts": parts,
    }
