import shutil
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import planted
import realdata
from dqslam import _core, io
from dqslam.assumptions import OdometryNoise
from dqslam.estimate import Estimate
from dqslam.evaluation import (
    common_poses,
    evaluate_association,
    evaluate_objects,
    evaluate_results,
)
from dqslam.io import Trajectory, load_recording, read_trajectory
from dqslam.metrics import align_positions, center_errors
from dqslam.pipeline import RunOptions, run
from dqslam.recording import Odometry
from dqslam.simulation import load_scenario, perturb_odometry, simulate


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return planted.write_planted(tmp_path_factory.mktemp("planted"), drift=0.3)


def judged(files, **options):
    results = io.load_results(files.results)
    return evaluate_results(
        results,
        read_trajectory(files.groundtruth),
        objects=io.read_true_objects(files.objects),
        boxes=io.read_true_boxes(files.boxes, results.camera),
        **options,
    )


def test_trajectories(files):
    found = judged(files, align="se3")
    assert (found["align"], found["poses"]) == ("se3", planted.POSES)
    assert found["ate"]["max"] == pytest.approx(0.0, abs=1e-7)
    assert found["rpe"]["translation"]["max"] == pytest.approx(0.0, abs=1e-7)
    # Drift along x grows by the same amount each step.
    step = 0.3 / (planted.POSES - 1)
    assert found["odometry_rpe"]["translation"]["rmse"] == pytest.approx(step, abs=1e-7)
    assert found["odometry_rpe"]["pairs"] == planted.POSES - 1
    assert found["odometry_rpe"]["rotation_deg"]["max"] == pytest.approx(0.0, abs=1e-4)
    assert found["odometry_ate"]["rmse"] > 0.05
    motion = found["true_from_estimated"]
    assert motion["by"] == "poses"
    np.testing.assert_allclose(motion["translation"], planted.SHIFT, atol=1e-7)
    turned = Rotation.from_quat(motion["rotation_xyzw"]) * planted.TURN.inv()
    assert turned.magnitude() == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize("axis", np.eye(3))
def test_a_truth_of_a_body_that_looks_elsewhere(files, axis):
    """Its positions are right, its orientations are not the camera's: they are left aside."""
    truth = read_trajectory(files.groundtruth)
    turns = Rotation.from_quat(truth.world_from_camera[:, 3:]) * Rotation.from_rotvec(1.5 * axis)
    poses = np.hstack([truth.world_from_camera[:, :3], turns.as_quat()])
    objects = io.read_true_objects(files.objects)
    body = Trajectory(truth.timestamps, poses)
    found = evaluate_results(io.load_results(files.results), body, objects=objects)
    assert found["true_from_estimated"]["by"] == "positions"
    assert found["ate"]["max"] == pytest.approx(0.0, abs=1e-7)
    first = check_objects(found["objects"])
    assert first["center"] == pytest.approx(planted.CENTER_ERROR, abs=1e-6)


def test_without_alignment_the_world_counts(files):
    found = judged(files, align="none")
    results, truth = io.load_results(files.results), read_trajectory(files.groundtruth)
    between = results.poses[:, :3] - truth.world_from_camera[:, :3]
    assert found["ate"]["mean"] == pytest.approx(np.linalg.norm(between, axis=1).mean())
    assert found["objects"]["matched"] == 0
    assert found["objects"]["center_median"] is None
    assert found["rpe"]["translation"]["max"] == pytest.approx(0.0, abs=1e-7)


def check_objects(objects):
    counts = {name: objects[name] for name in ("truth", "matched", "missed", "invented")}
    # 10, 11, 12 are mapped; 13 and 15 are not; 14 moves; 99 is of nothing.
    assert counts == {"truth": 5, "matched": 3, "missed": 2, "invented": 1}
    assert (objects["moving"], objects["moving_in_map"]) == (1, 1)
    first, second, third = objects["pairs"]
    assert [pair["true_id"] for pair in objects["pairs"]] == [10, 11, 12]
    assert second["center"] == pytest.approx(0.0, abs=1e-6)
    assert first["size_relative"] == pytest.approx(0.0, abs=1e-6)
    assert second["size_relative"] == pytest.approx(planted.SIZE_FACTOR - 1.0, abs=1e-6)
    assert second["volume_ratio"] == pytest.approx(planted.SIZE_FACTOR**3, abs=1e-6)
    assert second["iou_3d"] == pytest.approx(planted.SIZE_FACTOR**-3, abs=1e-3)
    assert second["orientation_deg"] == pytest.approx(0.0, abs=1e-4)
    assert third["orientation_deg"] == pytest.approx(planted.ANGLE, abs=1e-4)
    assert objects["size_relative_max"] == second["size_relative"]
    assert objects["orientation_deg_max"] == third["orientation_deg"]
    assert objects["center_median"] == pytest.approx(0.0, abs=1e-6)
    return first


@pytest.mark.parametrize("match", ["nearest", "id"])
def test_objects(files, match):
    objects = judged(files, match=match)["objects"]
    assert (objects["match"], objects["by_class"]) == (match, match == "nearest")
    assert check_objects(objects)["center"] == pytest.approx(planted.CENTER_ERROR, abs=1e-6)
    assert objects["center_mean"] == pytest.approx(planted.CENTER_ERROR / 3, abs=1e-6)


def test_a_similarity_scales_the_objects_too(tmp_path):
    files = planted.write_planted(tmp_path, scale=2.0)
    found = judged(files, align="sim3")
    assert found["ate"]["scale"] == pytest.approx(2.0)
    assert found["ate"]["max"] == pytest.approx(0.0, abs=1e-7)
    assert found["rpe"]["translation"]["max"] == pytest.approx(0.0, abs=1e-7)
    assert check_objects(found["objects"])["center"] == pytest.approx(2 * planted.CENTER_ERROR)
    assert judged(files, align="se3")["ate"]["rmse"] > 0.5


def test_a_gate_bounds_what_counts(files):
    objects = judged(files, gate=0.5 * planted.CENTER_ERROR)["objects"]
    assert [pair["id"] for pair in objects["pairs"]] == [11, 12]
    assert (objects["missed"], objects["invented"]) == (3, 2)


def test_without_sizes_classes_and_ids(files, tmp_path):
    lines = files.objects.read_text().splitlines()
    path = tmp_path / "objects.csv"
    keep = [",".join(line.split(",")[2:5]) for line in lines]
    path.write_text("\n".join(keep) + "\n")
    truth, results = io.read_true_objects(path), io.load_results(files.results)
    motion = align_positions(results.poses[:, :3], read_trajectory(files.groundtruth)[1][:, :3])
    found = evaluate_objects(results.objects, truth, motion, gate=0.03)
    assert (found["by_class"], found["matched"], found["moving"]) == (False, 4, 0)
    assert found["pairs"][0]["true_id"] is None
    assert found["size_relative_median"] is None
    assert found["iou_3d_mean"] is None
    with pytest.raises(ValueError, match="objects.csv: there are no ids to match by"):
        evaluate_objects(results.objects, truth, motion, match="id")


def test_boxes(files):
    found = judged(files)["reprojection_iou"]
    # Of 100 boxes those of object 13 are of nothing mapped; every fourth pose was held out.
    assert found["boxes"] == 60
    assert found["held_out"]["boxes"] == 20
    # Those that do not fit are of the displaced object, of the others one is too large and one
    # turned: their mean is that of 1, about 1 / factor^2, and something near.
    assert found["inliers"]["boxes"] == 45
    assert found["inliers"]["mean"] > found["mean"]
    assert 0.85 < found["inliers"]["median"] < 1.0
    assert found["mean"] == pytest.approx(found["held_out"]["mean"], abs=0.03)


def test_larger_by_a_factor_overlaps_by_its_square(files, tmp_path):
    """Keep one object's boxes: its projection is larger by the factor, nearly, in both axes."""
    copied = tmp_path / "out"
    shutil.copytree(files.results, copied)
    lines = (copied / "boxes.csv").read_text().splitlines()
    chosen = [line for line in lines[1:] if line.split(",")[9] == "11"]
    (copied / "boxes.csv").write_text("\n".join([lines[0], *chosen]) + "\n")
    found = evaluate_results(io.load_results(copied), read_trajectory(files.groundtruth))
    median = found["reprojection_iou"]["median"]
    assert median == pytest.approx(planted.SIZE_FACTOR**-2, abs=0.005)
    assert found["reprojection_iou"]["boxes"] == 15


def test_association(files):
    """Ids are right, but the truth says that object 12 is two, one after the other."""
    found = judged(files)["association"]
    used = planted.POSES * 3 // 4
    half = used // 2 + used % 2  # poses 0 to 9 have 8 that were used, the others 7
    pairs = used * (used - 1) // 2
    parts = sum(n * (n - 1) // 2 for n in (half, used - half))
    assert found["boxes"] == 5 * used
    assert found["precision"] == pytest.approx((4 * pairs + parts) / (5 * pairs))
    assert found["recall"] == 1.0
    assert found["purity"] == pytest.approx((4 * used + half) / (5 * used))
    assert found["id_switches"] == 0
    assert [found[name] for name in ("found", "missed", "split", "invented")] == [5, 1, 0, 0]


def test_boxes_are_needed_for_an_association(files):
    results = io.load_results(files.results)
    boxes = io.read_true_boxes(files.boxes, results.camera)
    late = io.TrueBoxes(boxes.path, boxes.timestamp + 1e3, boxes.box, boxes.object_id)
    truth = read_trajectory(files.groundtruth)
    with pytest.raises(ValueError, match="boxes_gt.csv: no box within 0.05 s of a pose"):
        evaluate_results(results, truth, boxes=late)
    without = replace(results, boxes=None)
    assert evaluate_results(without, truth)["reprojection_iou"] is None
    with pytest.raises(ValueError, match=r"out: there is no boxes\.csv, hence no association"):
        evaluate_results(without, truth, boxes=boxes)


def test_poses_of_the_same_time():
    poses = np.tile([0.0, 0, 0, 0, 0, 0, 1], (9, 1))
    truth = Trajectory(np.arange(9.0), poses)
    rows, true_rows = common_poses(np.array([0.4, 0.6, 2.0, 5.5, 20.0]), truth)
    np.testing.assert_array_equal(rows, [0, 1, 2, 3])
    np.testing.assert_array_equal(true_rows, [0, 1, 2, 5])
    rows, _ = common_poses(np.array([0.4, 0.6, 1.1, 2.0, 5.1]), truth, 0.2)
    np.testing.assert_array_equal(rows, [2, 3, 4])
    with pytest.raises(ValueError, match="2 poses within 0.1 s of the estimate's"):
        common_poses(np.array([0.4, 1.05, 2.0]), truth, 0.1)
    with pytest.raises(ValueError, match="0 poses within"):
        common_poses(np.array([0.4, 1.05, 2.0]), Trajectory(np.zeros(1), poses[:1]))


def test_table_top_is_judged_by_whole_poses(tmp_path):
    """Real boxes: six objects stand still, two were moved by hand."""
    folder = realdata.recording("bop_lmo")
    segment = folder / "seg_0703_1001"
    exact, _ = load_recording(
        folder / "camera.json",
        segment / "groundtruth.txt",
        segment / "detections_fasterrcnn.csv",
        ids="class_id",
    )
    drifted = perturb_odometry(exact, OdometryNoise(0.02, 0.01), seed=1)
    io.save_estimate(run(drifted).estimate, tmp_path, detections=drifted.detections)
    results, truth = io.load_results(tmp_path), read_trajectory(segment / "groundtruth.txt")
    objects = io.read_true_objects(segment / "objects_gt.csv")
    found = evaluate_results(results, truth, objects=objects)
    assert found["ate"]["rmse"] < 0.4 * found["odometry_ate"]["rmse"]
    assert found["reprojection_iou"]["inliers"]["median"] > 0.8
    found = found["objects"]
    assert [found[name] for name in ("matched", "missed", "invented", "moving")] == [6, 0, 0, 2]
    assert found["moving_in_map"] == len(results.objects) - 6
    assert found["center_median"] < 0.02
    by_positions = align_positions(results.poses[:, :3], truth[1][:, :3])
    rows = np.searchsorted(results.objects.object_ids, objects.id[objects.static])
    errors = center_errors(
        results.objects.centers[rows], objects.center[objects.static], by_positions
    )
    assert found["center_median"] < 0.9 * np.median(errors)


def test_classes_as_ids_on_a_real_desk(tmp_path):
    """Boxes of a distorting lens meet themselves; two tracks of one class cost precision."""
    folder = realdata.recording("tum_fr2_desk")
    boxes = folder / "detections_yolov5.csv"
    recording, _ = load_recording(
        folder / "camera.json", folder / "odometry_orbslam2_rgbd.txt", boxes, ids="class_id"
    )
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    nothing_mapped = Estimate(
        pose_model=_core.PoseModel.SE3,
        camera=recording.camera,
        timestamps=recording.timestamps,
        poses=path,
        initial_poses=path,
        object_ids=np.zeros(0, dtype=int),
        class_names=(),
        observations=np.zeros(0, dtype=int),
        dual_quadrics=np.zeros((0, 9)),
        ellipsoids=np.zeros((0, 9)),
        inliers=np.ones(len(recording.detections), dtype=bool),
    )
    io.save_estimate(nothing_mapped, tmp_path, detections=recording.detections)
    results = io.load_results(tmp_path)
    truth = io.read_true_boxes(boxes, results.camera, "derived_track_id")
    found = evaluate_association(results, truth, min_iou=0.95)
    # Each track has one class, so that all its boxes are together; some classes have several.
    assert (found["recall"], found["id_switches"], found["invented"]) == (1.0, 0, 0)
    assert found["found"] + found["missed"] == 27
    assert 0.2 < found["precision"] < found["purity"] < 1.0
    # A box that shows nobody knows what is not judged.
    known = np.isin(truth.object_id, -1, invert=True)
    assert 0 < found["boxes"] <= known.sum() < len(truth.box)


def test_poses_that_were_given_have_no_nees(tmp_path):
    recording, truth = simulate(load_scenario("orbit"), seed=1)
    steps = Odometry.from_poses(truth.poses, covariance=np.eye(6))
    known = replace(recording, odometry=steps, positions=None)
    result = run(known, RunOptions(mode=_core.Mode.MAPPING, trust_ids=1.0))
    io.save_estimate(result.estimate, tmp_path / "out", marginals=result.marginals)
    cameras = _core.world_from_camera(truth.pose_model, recording.camera, truth.poses)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = evaluate_results(
            io.load_results(tmp_path / "out"), Trajectory(known.timestamps, cameras)
        )
    assert found["nees"] is None
    assert found["ate"]["max"] == pytest.approx(0.0, abs=1e-7)
