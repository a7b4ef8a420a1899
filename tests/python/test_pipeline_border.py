"""Boxes that the border of the image cuts."""

import json
from dataclasses import replace

import numpy as np
import pytest

from dqslam import _core
from dqslam.assumptions import BoxNoise, SizePrior
from dqslam.estimate import Estimate
from dqslam.graph import build_graph, solve
from dqslam.io import load_recording
from dqslam.lens import cut_edges, undistort_boxes
from dqslam.pipeline import RunOptions, run
from dqslam.pipeline.border import with_cut_edges
from dqslam.pipeline.report import box_chi2, describe_boxes
from orbit import CAMERA, NAMES, make_orbit, write_orbit
from scenes import cut_by_the_border


def test_edges_on_the_border_are_told_from_edges_inside():
    camera = _core.Camera(500, 500, 320, 240, 640, 480)
    box = [[-0.5, 10, 50, 479.5], [4, 0, 639, 300], [10, 3, 636, 476]]
    expected = [[True, False, False, True], [False, True, True, False], [False] * 4]
    np.testing.assert_array_equal(cut_edges(camera, np.array(box)), expected)
    lens = _core.Camera(500, 500, 320, 240, 640, 480, distortion=[-0.3, 0.1, 0, 0, 0])
    undistorted = undistort_boxes(lens, np.array(box[:2]))
    assert undistorted[0, 0] < -20
    np.testing.assert_array_equal(cut_edges(lens, undistorted), expected[:2])


def test_edges_on_the_border_are_flagged_beside_those_that_were(files):
    recording, _ = load_recording(*files)
    box = recording.detections.box.copy()
    box[7, 2] = recording.camera.width - 0.5
    given = np.zeros(box.shape, dtype=bool)
    given[3, 1] = True
    boxes = replace(recording.detections, box=box, truncated=given)
    flagged = with_cut_edges(replace(recording, detections=boxes)).detections
    np.testing.assert_array_equal(np.argwhere(flagged.truncated), [[3, 1], [7, 2]])


def test_a_cut_edge_fits_when_the_object_reaches_it(files):
    recording, _ = load_recording(*files)
    estimate = run(recording, RunOptions(mode=_core.Mode.MAPPING)).estimate
    noise = BoxNoise(pixels=0.5, relative=0.0)
    left = np.tile([True, False, False, False], (len(recording.detections), 1))
    for inwards_px, is_reached in ((5.0, True), (-5.0, False)):
        box = recording.detections.box + np.array([inwards_px, 0.0, 0.0, 0.0])
        whole = replace(recording.detections, box=box)
        chi2 = box_chi2(estimate, whole, noise)
        cut_chi2 = box_chi2(estimate, replace(whole, truncated=left), noise)
        gone = chi2 - cut_chi2
        assert np.median(gone) == pytest.approx(100.0 if is_reached else 0.0, rel=0.1)


def test_a_perfect_estimate_fits_its_boxes_where_the_border_cuts_them():
    recording, ellipsoids = cut_by_the_border()
    poses = recording.odometry.first_pose[None]
    estimate = Estimate(
        pose_model=_core.PoseModel.SE3,
        camera=recording.camera,
        timestamps=recording.timestamps,
        poses=poses,
        initial_poses=poses,
        object_ids=np.arange(4),
        class_names=("cup",) * 4,
        observations=np.ones(4, dtype=int),
        dual_quadrics=np.array([_core.dual_quadric_from_ellipsoid(one) for one in ellipsoids]),
        ellipsoids=ellipsoids,
    )
    chi2 = box_chi2(estimate, recording.detections, BoxNoise())
    np.testing.assert_allclose(chi2, 0.0, atol=1e-4)
    assert describe_boxes(chi2)["outlier_share"] == 0.0
    # What no border cut must end at all edges where the object ends.
    whole = replace(recording.detections, truncated=np.zeros((4, 4), dtype=bool))
    assert (box_chi2(estimate, whole, BoxNoise()) > 13.28).all()


def test_boxes_cut_by_the_image_do_not_bend_the_map(tmp_path):
    """Narrow the image so that it cuts a fifth of the boxes: the centers stay."""
    orbit = make_orbit(noise_px=1.0)
    low, high = 215.0, 425.0
    kept = {}
    for key, box in orbit.boxes.items():
        if box[2] > low + 8 and box[0] < high - 8:
            kept[key] = np.clip(box, [low, -1e9, low, -1e9], [high, 1e9, high, 1e9])
    cut = np.mean([bool((box[0] == low) | (box[2] == high)) for box in kept.values()])
    assert 0.1 < cut < 0.5
    for box in kept.values():
        box[[0, 2]] -= low + 0.5
    orbit.boxes = kept
    files = write_orbit(tmp_path, orbit)
    narrow = CAMERA | {"cx": CAMERA["cx"] - low - 0.5, "width": int(high - low)}
    files[0].write_text(json.dumps(narrow))
    recording, _ = load_recording(*files)
    true = np.array([orbit.centers[name] for name in NAMES])

    def worst(found):
        return np.linalg.norm(found.centers - true, axis=1).max()

    aware = run(recording, RunOptions(mode=_core.Mode.MAPPING)).estimate
    options = _core.SolveOptions(mode=_core.Mode.MAPPING, loss=_core.Loss.CAUCHY)
    prior = SizePrior(np.log(0.1), 0.7)
    blind, _ = solve(build_graph(recording, size_prior=prior), options)
    assert worst(aware) < 0.01
    assert worst(aware) < 0.5 * worst(blind)
