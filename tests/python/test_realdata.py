"""Recordings of real detectors, where they are at hand: see realdata.py."""

import json

import numpy as np
import pytest

import realdata
from dqslam.cli import main
from dqslam.io import FileError, load_recording, read_trajectory


def call(command, folder, **options):
    """Run a command that writes to ``folder``."""
    words = [
        word for name, value in options.items() for word in (f"--{name.replace('_', '-')}", value)
    ]
    return main([command, *folder, *map(str, words)])


def run(out, **options):
    """Run a recording and return its report, whose doubts are those of the exit code."""
    code = call("run", (), out=out, **options)
    report = json.loads((out / "report.json").read_text())
    assert code == (3 if report["doubts"] else 0)
    return report


def judge(out, **truth):
    """Compare results with the truth and return the evaluation."""
    assert call("evaluate", (str(out),), **truth) == 0
    return json.loads((out / "evaluation.json").read_text())


@pytest.mark.parametrize("ids", ["class_id", "none"])
@pytest.mark.parametrize("detector", ["fasterrcnn", "maskrcnn"])
@pytest.mark.parametrize("seed", range(5))
def test_table_top(tmp_path, seed, detector, ids):
    """Two of the eight objects were moved by hand; the boxes have false positives."""
    folder = realdata.recording("bop_lmo")
    segment = folder / "seg_0703_1001"
    truth = segment / "groundtruth.txt"
    run(
        tmp_path,
        camera=folder / "camera.json",
        odometry=truth,
        detections=segment / f"detections_{detector}.csv",
        ids=ids,
        perturb_odometry="translation=0.02,rotation=0.01",
        seed=seed,
    )
    found = judge(tmp_path, groundtruth=truth, objects=segment / "objects_gt.csv")
    assert found["ate"]["rmse"] <= 0.3 * found["odometry_ate"]["rmse"]
    assert (found["objects"]["matched"], found["objects"]["missed"]) == (6, 0)
    assert found["objects"]["center_median"] <= 0.020


@pytest.mark.parametrize("seed", range(3))
def test_street_without_ids(tmp_path, seed):
    """A detector's boxes of cars, about half of which are parked; the odometry is made worse."""
    folder = realdata.recording("kitti_tracking") / "0005"
    truth = folder / "trajectory_reference.txt"
    report = run(
        tmp_path,
        camera=folder / "camera.json",
        odometry=truth,
        detections=folder / "detections_rrc.csv",
        ids="none",
        perturb_odometry="translation=0.05,rotation=0.002",
        seed=seed,
    )
    found = judge(tmp_path, groundtruth=truth, objects=folder / "objects_gt_world.csv")
    assert found["ate"]["rmse"] < found["odometry_ate"]["rmse"]
    # Cars that drive are not in the map, which may be a doubt, but the only one.
    assert all("boxes show an object of the map" in one for one in report["doubts"])
    objects = found["objects"]
    assert objects["matched"] + objects["missed"] == 18
    assert objects["matched"] >= 0.8 * 18


def test_cabinet_is_mapped_from_known_poses(tmp_path):
    folder = realdata.recording("tum_fr3_cabinet")
    report = run(
        tmp_path,
        camera=folder / "camera.json",
        odometry=folder / "groundtruth.txt",
        detections=folder / "detections_yolo.csv",
        min_score=0.1,
        mode="mapping",
    )
    assert (report["poses"], report["boxes"]["count"]) == (58, 51)
    assert [entry["class_name"] for entry in report["objects"]] == ["cabinet"]
    assert report["reprojection"]["iou_median"] >= 0.8


def desk():
    """Return the folder of the desk, and the arguments that its files are."""
    folder = realdata.recording("tum_fr2_desk")
    return folder, {
        "camera": folder / "camera.json",
        "odometry": folder / "odometry_orbslam2_rgbd.txt",
        "detections": folder / "detections_yolov5.csv",
    }


def test_desk_as_it_is(tmp_path):
    """A long video of a cluttered desk, the odometry that a robot had, and no ids."""
    folder, files = desk()
    report = run(tmp_path, **files, ids="none", hold_out=0.2)
    assert 15 <= len(report["objects"]) <= 40
    assert report["reprojection"]["held_out"]
    assert report["reprojection"]["iou_median"] >= 0.75
    assert report["reprojection"]["explained_share"] >= 0.9
    assert report["odometry_noise"]["from"] == "estimated"
    found = judge(
        tmp_path,
        groundtruth=folder / "groundtruth_mocap_100hz.txt",
        boxes=files["detections"],
        box_ids="derived_track_id",
    )
    assert found["ate"]["rmse"] <= 1.05 * found["odometry_ate"]["rmse"]
    assert found["association"]["purity"] >= 0.95


def test_desk_is_read_with_its_gaps_and_without_ids():
    folder, files = desk()
    recording, dropped = load_recording(*files.values(), ids="none", min_score=0)
    assert len(recording.timestamps) == 2893 + 72  # of the file, and of images between these
    assert len(recording.detections) + dropped.total == 34331
    assert dropped.without_pose > 0
    assert np.isfinite(recording.detections.box).all()
    with pytest.raises(FileError, match="no column track_id .*derived_track_id"):
        load_recording(*files.values(), ids="track_id")
    mocap = read_trajectory(folder / "groundtruth_mocap_100hz.txt", repeated_times=True)
    assert len(mocap[0]) == 20956
