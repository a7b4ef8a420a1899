"""Recordings of real detectors, where they are at hand: see realdata.py."""

import csv
import json

import numpy as np
import pytest

import realdata
from dqslam import _core
from dqslam.cli import main
from dqslam.evaluate import absolute_trajectory_error, center_errors
from dqslam.io import FileError, OdometryNoise, load_recording, read_trajectory
from dqslam.run_recording import perturb_odometry, run


def read_csv(path):
    lines = path.read_text().splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def columns(rows, *names):
    return np.array([[float(row[name]) for name in names] for row in rows])


@pytest.mark.parametrize("detector", ["fasterrcnn", "maskrcnn"])
@pytest.mark.parametrize("seed", range(10))
def test_table_top(seed, detector):
    """Two of the eight objects were moved by hand; the boxes have false positives."""
    folder = realdata.recording("bop_lmo")
    segment = folder / "seg_0703_1001"
    exact, _ = load_recording(
        folder / "camera.json",
        segment / "groundtruth.txt",
        segment / f"detections_{detector}.csv",
        ids="class_id",
    )
    truth = read_trajectory(segment / "groundtruth.txt")
    result = run(perturb_odometry(exact, OdometryNoise(0.02, 0.01), seed=seed), reference=truth)
    error = result.report["trajectory_error"]
    assert error["after"]["ate_rmse_m"] < 0.4 * error["before"]["ate_rmse_m"]
    assert error["after"]["mean_m"] < error["before"]["mean_m"]

    static = [row for row in read_csv(segment / "objects_gt.csv") if row["static"] == "1"]
    assert len(static) == 6
    rows = np.searchsorted(result.estimate.object_ids, columns(static, "object_id")[:, 0])
    true_path = truth.world_from_camera[:, :3]
    alignment = absolute_trajectory_error(result.estimate.poses[:, :3], true_path).alignment
    centers = center_errors(
        result.estimate.centers[rows], columns(static, "tx", "ty", "tz"), alignment
    )
    assert np.median(centers) < 0.03

    share = {entry["class_name"]: entry["outlier_share"] for entry in result.report["objects"]}
    assert share.pop("ape") > 0.5  # moved
    assert share.pop("duck") > max(0.05, min(share.values()))  # moved, less far


def static_boxes(folder, tmp_path):
    lines = (folder / "boxes_gt.csv").read_text().splitlines()
    assert lines[0].endswith(",static")
    path = tmp_path / "static.csv"
    path.write_text("\n".join(line for line in lines if not line.endswith(",0")) + "\n")
    return path


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_street_is_reported_as_it_is(tmp_path, seed, capsys):
    folder = realdata.recording("kitti_tracking") / "0005"
    reference = folder / "trajectory_reference.txt"
    out = tmp_path / "out"
    arguments = {
        "--camera": folder / "camera.json",
        "--odometry": reference,
        "--detections": static_boxes(folder, tmp_path),
        "--perturb-odometry": "translation=0.05,rotation=0.002",
        "--seed": seed,
        "--out": out,
    }
    assert main(["run", *(str(word) for pair in arguments.items() for word in pair)]) == 0
    report = json.loads((out / "report.json").read_text())
    assert (report["boxes"]["count"], len(report["objects"])) == (609, 18)
    assert report["boxes"]["outlier_share"] < 0.02
    assert report["boxes"]["not_in_front"] == 0
    error = report["trajectory_error"]
    true = read_trajectory(reference).world_from_camera[:, :3]
    for when, name in (("before", "odometry.txt"), ("after", "trajectory.txt")):
        path = read_trajectory(out / name).world_from_camera[:, :3]
        rmse = absolute_trajectory_error(path, true).rmse
        assert error[when]["ate_rmse_m"] == pytest.approx(rmse, abs=1e-6)
    better = error["after"]["ate_rmse_m"] < error["before"]["ate_rmse_m"]
    shown = next(line for line in capsys.readouterr().out.splitlines() if "alignment" in line)
    assert ("better" if better else "worse") in shown


def test_cabinet_is_mapped_from_known_poses():
    folder = realdata.recording("tum_fr3_cabinet")
    recording, dropped = load_recording(
        folder / "camera.json",
        folder / "groundtruth.txt",
        folder / "detections_yolo.csv",
        min_score=0.1,
    )
    assert (len(recording.timestamps), len(recording.detections), dropped.total) == (58, 51, 0)
    estimate = run(recording, mode=_core.Mode.MAPPING).estimate
    assert estimate.class_names == ("cabinet",)
    pose = recording.detections.pose
    boxes, in_front = _core.project_to_boxes(
        estimate.pose_model,
        estimate.camera,
        estimate.poses[pose],
        np.repeat(estimate.ellipsoids, len(pose), axis=0),
    )
    assert in_front.all()
    assert np.median(overlap(boxes, recording.detections.box)) > 0.8


def overlap(boxes, others):
    """Return intersection over union, row by row."""
    low, high = np.maximum(boxes, others)[:, :2], np.minimum(boxes, others)[:, 2:]
    both = np.prod(np.clip(high - low, 0, None), axis=1)
    areas = [np.prod(box[:, 2:] - box[:, :2], axis=1) for box in (boxes, others)]
    return both / (areas[0] + areas[1] - both)


def test_desk_is_read_with_its_gaps_and_without_ids():
    folder = realdata.recording("tum_fr2_desk")
    files = (
        folder / "camera.json",
        folder / "odometry_orbslam2_rgbd.txt",
        folder / "detections_yolov5.csv",
    )
    recording, dropped = load_recording(*files, ids="class_id", min_score=0)
    assert len(recording.timestamps) == 2893
    assert len(recording.detections) + dropped.total == 34331
    assert dropped.without_pose > 0
    assert np.isfinite(recording.detections.box).all()
    with pytest.raises(FileError, match="no column track_id .*derived_track_id"):
        load_recording(*files, ids="track_id")
    assert len(read_trajectory(folder / "groundtruth_mocap_100hz.txt", repeated_times=True)[0]) == (
        20956
    )
