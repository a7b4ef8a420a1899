import json
from dataclasses import replace

import numpy as np
import pytest

from dqslam import _core
from dqslam.evaluate import absolute_trajectory_error, center_errors
from dqslam.io import FileError, OdometryNoise, Trajectory, load_recording, nearest_pose
from dqslam.problem import BoxNoise, build_graph, solve
from dqslam.recording import RelativePositions
from dqslam.run_recording import (
    box_chi2,
    cut_edges,
    perturb_odometry,
    run,
    with_cut_edges,
)
from dqslam.run_recording.hold_out import choose_held_out, describe_overlap
from dqslam.size_prior import SizePrior, SizePriors
from orbit import CAMERA, NAMES, make_orbit, write_orbit

NOISE = OdometryNoise(translation_m=0.01, rotation_rad=0.01)


@pytest.fixture(scope="module")
def orbit():
    return make_orbit(noise_px=1.0)


@pytest.fixture
def files(tmp_path, orbit):
    return write_orbit(tmp_path, orbit)


def edit(path, change):
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")


def add_rows(path, *rows):
    edit(path, lambda lines: lines + list(rows))


# --- loading


def test_recording_holds_what_the_files_hold(files, orbit):
    recording, dropped = load_recording(*files)
    assert dropped.total == 0
    np.testing.assert_array_equal(recording.timestamps, orbit.times)
    detections = recording.detections
    assert detections.class_names == NAMES
    keys = zip(detections.pose, detections.object_id - 100, strict=True)
    expected = np.array([orbit.boxes[int(pose), int(name)] for pose, name in keys])
    np.testing.assert_allclose(detections.box, expected, atol=1e-12)
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    np.testing.assert_allclose(path[:, :3], orbit.poses[:, :3], atol=1e-12)
    np.testing.assert_allclose(
        odometry.covariance[7], np.diag([1e-4] * 3 + [2.5e-5] * 3), rtol=1e-12
    )


def test_ids_come_from_the_named_column(files):
    recording, _ = load_recording(*files, ids="class_id")
    assert sorted(set(recording.detections.object_id.tolist())) == list(NAMES)


def test_distorted_boxes_are_undistorted(files, orbit):
    edit(files[0], lambda lines: [lines[0][:-1] + ', "distortion": [-0.3, 0.1, 0.001, -5e-4]}'])
    recording, _ = load_recording(*files)
    box = recording.detections.box
    original = load_recording(*write_orbit(files[0].parent, orbit))[0].detections.box
    assert np.abs(box - original).max() > 2
    middle_v = 0.5 * (box[:, 1] + box[:, 3])
    left = recording.camera.distort_points(np.column_stack([box[:, 0], middle_v]))[:, 0]
    # An edge is undistorted at the middle of the distorted box, at not quite the same height.
    np.testing.assert_allclose(left, original[:, 0], atol=0.1)


def test_a_box_where_the_lens_has_no_inverse_is_named(files, orbit):
    edit(files[0], lambda lines: [lines[0][:-1] + ', "distortion": [-0.9, 0, 0, 0]}'])
    times = orbit.times.tolist()
    places = ("300,238,302,240", "310,238,312,240", "0,0,2,2")
    rows = [f"{i},{times[i]!r},{place},0.9,1,cup,55" for i, place in enumerate(places)]
    add_rows(files[2], *rows)
    with pytest.raises(FileError, match=r"boxes\.csv:164: the distortion in .*json has no"):
        load_recording(*files)


def test_every_dropped_box_is_counted(files, orbit):
    t = orbit.times.tolist()
    add_rows(
        files[2],
        f"3,{t[3]!r},1,1,9,9,0.4999,1,cup,101",
        f"3,{t[3]!r},1,1,9,9,0.5,1,cup,-1",
        f"3,{t[3]!r},1,1,9,9,0.5,1,cup,",
        f"3,{t[3]!r},1,1,9,9,0.89,1,cup,101",
        f"2000,{t[-1] + 1!r},1,1,9,9,0.9,1,cup,101",
        f"3,{t[3]!r},1,1,9,9,0.9,1,cup,7",
        f"4,{t[4]!r},1,1,9,9,0.9,1,cup,7",
    )
    recording, dropped = load_recording(*files)
    assert (dropped.below_min_score, dropped.without_id, dropped.without_pose) == (1, 2, 1)
    assert (dropped.repeated, dropped.few_boxes, dropped.total) == (1, {7: 2}, 7)
    assert len(recording.detections) == len(orbit.boxes)
    assert np.all(recording.detections.box[:, 2] > 9)


def test_of_several_boxes_the_nearest_in_time_wins_then_the_best(files, orbit):
    # The image between poses 3 and 4 has its own, better scored box of the cup.
    time = orbit.times[3].item()
    edit(
        files[2],
        lambda lines: [
            line.replace(",0.9,1,", ",0.6,1,") if line.startswith("3,") else line for line in lines
        ],
    )
    edit(
        files[2],
        lambda lines: [
            lines[0],
            f"3,{time!r},5,5,9,9,0.7,1,cup,101",
            *(line for line in lines[1:] if not line.startswith("4,")),
            f"4,{time + 0.03!r},1,1,9,9,0.99,1,cup,101",
        ],
    )
    recording, dropped = load_recording(*files)
    detections = recording.detections
    row = np.flatnonzero((detections.pose == 3) & (detections.object_id == 101))
    np.testing.assert_array_equal(detections.box[row], [[5, 5, 9, 9]])
    assert dropped.repeated == 2


def test_boxes_meet_the_nearest_pose(files, orbit):
    pose, late = nearest_pose(orbit.times, np.array([-5, 100.04, 100.06, 1e4]))
    np.testing.assert_array_equal(pose, [0, 0, 1, len(orbit.times) - 1])
    np.testing.assert_allclose(late[1:3], 0.04, atol=1e-9)
    shift = 0.03
    edit(
        files[1],
        lambda lines: [
            f"{float(line.split()[0]) + shift!r} " + line.split(" ", 1)[1] for line in lines
        ],
    )
    assert load_recording(*files)[1].without_pose == 0
    with pytest.raises(FileError, match="160 further than 0.02 s from a pose"):
        load_recording(*files, max_time_difference=0.02)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"min_score": 0.95}, r"boxes\.csv: no object is left of 160 boxes: 160 below"),
        ({"min_score": 1.5}, "min_score is 1.5, not between 0 and 1"),
        ({"min_score": float("nan")}, "min_score is nan"),
        ({"ids": "name"}, "ids is 'name', not 'track_id', 'class_id' or 'none'"),
        ({"max_time_difference": -1.0}, "max_time_difference is -1, negative"),
    ],
)
def test_settings_that_make_no_sense(files, keywords, message):
    with pytest.raises(ValueError, match=message):
        load_recording(*files, **keywords)


def test_a_file_without_track_ids_says_what_it_has(files):
    edit(files[2], lambda lines: [lines[0].replace("track_id", "derived_track_id"), *lines[1:]])
    with pytest.raises(FileError, match=r"boxes\.csv:1: no column track_id \(.*derived_track_id\)"):
        load_recording(*files)
    assert len(load_recording(*files, ids="class_id")[0].detections) == 160


def test_one_pose_is_no_trajectory(files):
    edit(files[1], lambda lines: lines[:1])
    with pytest.raises(FileError, match=r"traj\.txt: one pose only"):
        load_recording(*files)


# --- perturbation


def test_perturbation_has_the_sigmas_it_says(files):
    recording, _ = load_recording(*files)
    odometry = recording.odometry
    tangents = np.concatenate(
        [
            _core.minus(
                odometry.pose_model,
                perturb_odometry(recording, NOISE, seed=seed).odometry.relative,
                odometry.relative,
            )
            for seed in range(100)
        ]
    )
    # 3900 samples: 1.1 % standard error of a sigma.
    np.testing.assert_allclose(tangents.std(axis=0), [0.01] * 6, rtol=0.05)
    np.testing.assert_allclose(tangents.mean(axis=0), 0, atol=6e-4)


def test_perturbation_is_repeatable_and_starts_at_the_same_pose(files):
    recording, _ = load_recording(*files)
    first, again, other = (perturb_odometry(recording, NOISE, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.odometry.relative, again.odometry.relative)
    assert not np.array_equal(first.odometry.relative, other.odometry.relative)
    np.testing.assert_array_equal(first.odometry.first_pose, recording.odometry.first_pose)
    np.testing.assert_allclose(first.odometry.covariance[0], np.eye(6) * 1e-4)
    believed = perturb_odometry(recording, NOISE, seed=1, believed=OdometryNoise(0.5, 0.1))
    np.testing.assert_array_equal(believed.odometry.relative, first.odometry.relative)
    np.testing.assert_allclose(believed.odometry.covariance[0, 0, 0], 0.25)


@pytest.mark.parametrize("sigma", [0.0, -0.1, 1e-200, 1e200, float("nan"), float("inf")])
def test_sigmas_must_make_sense(sigma):
    with pytest.raises(ValueError, match="odometry noise: rotation is .*, not between"):
        OdometryNoise(0.1, sigma)


# --- the whole


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_slam_beats_its_odometry(files, orbit, seed):
    recording, _ = load_recording(*files)
    truth = Trajectory(orbit.times, orbit.poses)
    result = run(perturb_odometry(recording, NOISE, seed=seed), reference=truth)
    error = result.report["trajectory_error"]
    assert error["poses"] == len(orbit.times)
    assert error["after"]["ate_rmse_m"] < 0.4 * error["before"]["ate_rmse_m"]
    assert error["after"]["ate_rmse_m"] < 0.02
    aligned = absolute_trajectory_error(result.estimate.poses[:, :3], orbit.poses[:, :3])
    assert error["after"]["ate_rmse_m"] == pytest.approx(aligned.rmse)
    true_centers = np.array([orbit.centers[name] for name in NAMES])
    assert center_errors(result.estimate.centers, true_centers, aligned.alignment).max() < 0.02
    boxes = result.report["boxes"]
    assert boxes["count"] == 160
    assert boxes["outlier_share"] == 0
    assert [entry["class_name"] for entry in result.report["objects"]] == list(NAMES.values())


def test_same_seed_same_bits(files):
    recording, _ = load_recording(*files)
    noisy = perturb_odometry(recording, NOISE, seed=3)
    one, two = run(noisy), run(noisy)
    np.testing.assert_array_equal(one.estimate.poses, two.estimate.poses)
    np.testing.assert_array_equal(one.estimate.ellipsoids, two.estimate.ellipsoids)


def test_mapping_leaves_the_path_alone(files, orbit):
    recording, _ = load_recording(*files)
    result = run(recording, mode=_core.Mode.MAPPING)
    np.testing.assert_allclose(result.estimate.poses[:, :3], orbit.poses[:, :3], atol=1e-12)
    true_centers = np.array([orbit.centers[name] for name in NAMES])
    assert np.linalg.norm(result.estimate.centers - true_centers, axis=1).max() < 0.01
    assert result.report["trajectory_error"] is None
    assert result.report["mode"] == "mapping"


def test_an_object_that_moves_shows_in_the_report(tmp_path):
    orbit = make_orbit(noise_px=1.0)
    for pose in range(20, 40):  # the lamp trades places with the book
        orbit.boxes[pose, 5] = orbit.boxes[pose, 2] + 0.5
    recording, _ = load_recording(*write_orbit(tmp_path, orbit))
    result = run(
        perturb_odometry(recording, NOISE, seed=0),
        reference=Trajectory(orbit.times, orbit.poses),
    )
    outliers = {entry["class_name"]: entry["outlier_share"] for entry in result.report["objects"]}
    assert outliers["lamp"] > 0.3
    assert max(share for name, share in outliers.items() if name != "lamp") < 0.05
    error = result.report["trajectory_error"]
    assert error["after"]["ate_rmse_m"] < error["before"]["ate_rmse_m"]


def test_box_chi2_is_what_its_name_says(files):
    recording, _ = load_recording(*files)
    estimate = run(recording, mode=_core.Mode.MAPPING).estimate
    noise = BoxNoise(pixels=2.0, relative=0.0)
    detections = recording.detections
    row = int(np.searchsorted(estimate.object_ids, detections.object_id[5]))
    predicted, _ = _core.project_to_boxes(
        estimate.pose_model,
        estimate.camera,
        estimate.poses[detections.pose[5:6]],
        estimate.ellipsoids[row : row + 1],
    )
    expected = np.sum((predicted[0] - detections.box[5]) ** 2) / 4
    assert box_chi2(estimate, detections, noise)[5] == pytest.approx(expected)


def test_edges_on_the_border_are_told_from_edges_inside():
    camera = _core.Camera(500, 500, 320, 240, 640, 480)
    box = [[-0.5, 10, 50, 479.5], [4, 0, 639, 300], [10, 3, 636, 476]]
    expected = [[True, False, False, True], [False, True, True, False], [False] * 4]
    np.testing.assert_array_equal(cut_edges(camera, np.array(box)), expected)
    lens = _core.Camera(500, 500, 320, 240, 640, 480, distortion=[-0.3, 0.1, 0, 0, 0])
    undistorted = lens.undistort_boxes(np.array(box[:2]))
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
    estimate = run(recording, mode=_core.Mode.MAPPING).estimate
    noise = BoxNoise(pixels=0.5, relative=0.0)
    left = np.tile([True, False, False, False], (len(recording.detections), 1))
    for inwards_px, is_reached in ((5.0, True), (-5.0, False)):
        box = recording.detections.box + np.array([inwards_px, 0.0, 0.0, 0.0])
        whole = replace(recording.detections, box=box)
        chi2 = box_chi2(estimate, whole, noise)
        cut_chi2 = box_chi2(estimate, replace(whole, truncated=left), noise)
        gone = chi2 - cut_chi2
        assert np.median(gone) == pytest.approx(100.0 if is_reached else 0.0, rel=0.1)


def test_boxes_of_a_dropped_object_do_not_fit(files):
    recording, _ = load_recording(*files)
    estimate = run(recording, mode=_core.Mode.MAPPING).estimate
    part = replace(
        estimate,
        object_ids=estimate.object_ids[:-1],
        ellipsoids=estimate.ellipsoids[:-1],
        dual_quadrics=estimate.dual_quadrics[:-1],
    )
    chi2 = box_chi2(part, recording.detections, BoxNoise())
    is_last = recording.detections.object_id == estimate.object_ids[-1]
    np.testing.assert_array_equal(np.isinf(chi2), is_last)


def test_size_priors_of_classes_are_reported_and_checked(files):
    recording, _ = load_recording(*files)
    broad = SizePrior(np.log(0.1), 0.7)
    result = run(recording, size_prior=SizePriors({"cup": SizePrior(np.log(0.05), 0.2)}, broad))
    assert result.report["size_prior"]["classes"]["cup"]["median_m"] == pytest.approx(0.05)
    assert result.report["dropped_objects"] == {}
    with pytest.raises(ValueError, match=r"no class 'sofa' in the recording, only: .*cup"):
        run(recording, size_prior=SizePriors({"sofa": broad}))


def test_boxes_cut_by_the_image_do_not_bend_the_map(tmp_path):
    """Narrow the image so that it cuts a fifth of the boxes: the centres stay."""
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

    aware = run(recording, mode=_core.Mode.MAPPING).estimate
    options = _core.SolveOptions(mode=_core.Mode.MAPPING, loss=_core.Loss.CAUCHY)
    prior = SizePrior(np.log(0.1), 0.7)
    blind, _ = solve(build_graph(recording, size_prior=prior), options)
    assert worst(aware) < 0.01
    assert worst(aware) < 0.5 * worst(blind)


def test_reference_in_another_frame_and_rate(files, orbit):
    recording, _ = load_recording(*files)
    noisy = perturb_odometry(recording, NOISE, seed=0)
    here = Trajectory(orbit.times, orbit.poses)
    move = np.array([[3.0, -2.0, 1.0, 0.5, 0.5, 0.5, 0.5]])
    moved = _core.compose(_core.PoseModel.SE3, move.repeat(len(orbit.poses), axis=0), orbit.poses)
    there = Trajectory(orbit.times + 0.004, moved)
    errors = [run(noisy, reference=path).report["trajectory_error"] for path in (here, there)]
    for when in ("before", "after"):
        for name in ("ate_rmse_m", "mean_m"):
            assert errors[0][when][name] == pytest.approx(errors[1][when][name], rel=1e-6)


def test_reference_of_another_time(files, orbit):
    recording, _ = load_recording(*files)
    with pytest.raises(ValueError, match="groundtruth: 0 poses within 0.05 s of the estimate's"):
        run(recording, reference=Trajectory(orbit.times + 1000, orbit.poses))


# --- what does not come into the map


def with_boxes(recording, rows=slice(None), **changes):
    detections = replace(recording.detections, **changes).select(rows)
    return replace(recording, detections=detections)


def assert_is_odometry(result, recording):
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    np.testing.assert_array_equal(result.estimate.poses, path)
    assert result.estimate.object_ids.shape == (0,)
    assert (result.marginals, result.summary, result.report["solver"]) == (None, None, None)
    assert result.report["objects"] == []


@pytest.mark.parametrize("trust", [1.0, 0.9])
def test_without_a_place_for_any_object_the_odometry_is_returned(files, trust):
    recording, _ = load_recording(*files)
    corner = np.random.default_rng(1).uniform([0, 0], [500, 400], (160, 2))
    anywhere = with_boxes(recording, box=np.hstack([corner, corner + 60.0]))
    result = run(perturb_odometry(anywhere, NOISE, seed=0), trust_ids=trust, estimates_noise=True)
    assert_is_odometry(result, perturb_odometry(anywhere, NOISE, seed=0))
    assert result.report["reprojection"]["iou_median"] is None
    why = "no place explains its boxes, or they leave its distance open"
    names = ["101", "102", "105", "109"] if trust == 1.0 else []
    assert result.report["dropped_objects"] == dict.fromkeys(names, why)


def test_no_boxes_leave_the_odometry(files):
    recording, _ = load_recording(*files)
    for rows in (slice(0), recording.detections.pose == 0, recording.detections.pose == 39):
        part = with_boxes(recording, rows)
        assert_is_odometry(run(part, trust_ids=0.9, estimates_noise=True), part)
    held_out = run(with_boxes(recording, slice(20)), hold_out=0.99)
    assert held_out.held_out.all()
    assert_is_odometry(held_out, recording)


def test_an_object_of_too_few_boxes_is_named(files):
    recording, _ = load_recording(*files)
    lamp = np.flatnonzero(recording.detections.object_id == 105)
    kept = np.ones(160, dtype=bool)
    kept[lamp[3:]] = False
    report = run(with_boxes(recording, kept)).report
    assert [entry["id"] for entry in report["objects"]] == [101, 102, 109]
    assert report["dropped_objects"] == {"105": "seen from 3 viewpoints, 4 are needed"}


def test_ids_may_be_any_number(files):
    recording, _ = load_recording(*files)
    large = with_boxes(recording, object_id=recording.detections.object_id + 10**15)
    estimate = run(large).estimate
    np.testing.assert_array_equal(estimate.object_ids - 10**15, [101, 102, 105, 109])
    np.testing.assert_array_equal(estimate.observations, [40] * 4)


def test_relative_positions_take_no_part(files):
    recording, _ = load_recording(*files)
    wrong = RelativePositions([5], [101], [[0.0, 0.0, 50.0]], [1e-6 * np.eye(3)])
    with_them = run(replace(recording, positions=wrong)).estimate
    np.testing.assert_array_equal(with_them.poses, run(recording).estimate.poses)


# --- boxes held out


def test_held_out_boxes_take_no_part(files):
    """Moved anywhere, they change nothing of the estimate."""
    recording, _ = load_recording(*files, ids="none")
    noisy = perturb_odometry(recording, NOISE, seed=0)
    options = {"trust_ids": 0.9, "hold_out": 0.25, "seed": 3, "estimates_noise": True}
    first = run(noisy, **options)
    assert first.held_out.sum() == 40
    box = noisy.detections.box.copy()
    box[first.held_out] = [300.0, 200.0, 310.0, 210.0]
    other = run(with_boxes(noisy, box=box), **options)
    np.testing.assert_array_equal(other.held_out, first.held_out)
    np.testing.assert_array_equal(other.estimate.poses, first.estimate.poses)
    np.testing.assert_array_equal(other.estimate.ellipsoids, first.estimate.ellipsoids)
    tested = [one.report["reprojection"] for one in (first, other)]
    assert [one["boxes"] for one in tested] == [40, 40]
    assert tested[0]["iou_median"] > 0.85
    assert tested[0]["explained_share"] == 1.0
    assert tested[1]["explained_share"] == 0.0


def test_held_out_boxes_are_called_what_they_show(files):
    recording, _ = load_recording(*files)
    result = run(recording, hold_out=0.25)
    np.testing.assert_array_equal(result.detections.object_id, recording.detections.object_id)
    assert result.report["reprojection"]["held_out"]
    assert result.report["boxes"]["count"] == 120
    assert not run(recording).report["reprojection"]["held_out"]


def test_boxes_are_held_out_by_the_seed():
    chosen = choose_held_out(1000, 0.3, seed=1)
    assert chosen.sum() == 300
    np.testing.assert_array_equal(chosen, choose_held_out(1000, 0.3, seed=1))
    assert not np.array_equal(chosen, choose_held_out(1000, 0.3, seed=2))
    assert not choose_held_out(1000, 0.0, seed=1).any()


@pytest.mark.parametrize("share", [-0.1, 1.0, 2.0, float("nan")])
def test_shares_to_hold_out_must_make_sense(files, share):
    with pytest.raises(ValueError, match="the share to hold out is .*, not at least 0 and below 1"):
        run(load_recording(*files)[0], hold_out=share)


def test_overlaps_are_described():
    overlap = np.array([0.9, 0.4, 0.0, np.nan, 0.8])
    assert describe_overlap(overlap) == {
        "boxes": 5,
        "of_mapped_classes": 4,
        "matched": 3,
        "iou_median": pytest.approx(0.8),
        "explained_share": 0.5,
    }


# --- without ids, and with ids that are not final


def test_boxes_without_ids_give_the_same_map(files, orbit):
    recording, dropped = load_recording(*files, ids="none")
    assert dropped.total == 0
    assert np.all(recording.detections.object_id == -1)
    truth = Trajectory(orbit.times, orbit.poses)
    noisy = perturb_odometry(recording, NOISE, seed=1)
    result = run(noisy, trust_ids=0.9, reference=truth)
    error = result.report["trajectory_error"]
    assert error["after"]["ate_rmse_m"] < 0.4 * error["before"]["ate_rmse_m"]
    assert [entry["observations"] for entry in result.report["objects"]] == [40] * 4
    np.testing.assert_array_equal(result.estimate.object_ids, range(4))
    assert sorted(result.estimate.class_names) == sorted(NAMES.values())


def test_without_ids_the_odometry_may_be_the_truth(files, orbit):
    recording, _ = load_recording(*files, ids="none")
    result = run(recording, trust_ids=0.9, mode=_core.Mode.MAPPING, estimates_noise=True)
    np.testing.assert_allclose(result.estimate.poses[:, :3], orbit.poses[:, :3], atol=1e-9)
    assert result.report["odometry_noise"] == {"from": "given"}
    centers = {
        name: place for name, place in zip(NAMES.values(), orbit.centers.values(), strict=True)
    }
    for name, center in zip(result.estimate.class_names, result.estimate.centers, strict=True):
        np.testing.assert_allclose(center, centers[name], atol=0.01)


def test_the_noise_of_odometry_is_told_when_it_is_estimated(files):
    recording, _ = load_recording(*files)
    noise = run(perturb_odometry(recording, NOISE, seed=0), estimates_noise=True).report
    noise = noise["odometry_noise"]
    assert noise["from"] == "estimated"
    assert noise["translation_m"] == pytest.approx(0.01, rel=0.5)
    assert noise["rotation_rad"] == pytest.approx(0.01, rel=0.5)


def test_ids_that_are_not_final_keep_boxes_without_one(files, orbit):
    time = orbit.times[3].item()
    add_rows(files[2], f"3,{time!r},1,1,9,9,0.5,1,cup,", f"3,{time!r},20,1,30,9,0.8,1,cup,101")
    final, dropped = load_recording(*files)
    assert (len(final.detections), dropped.without_id, dropped.repeated) == (160, 1, 1)
    open_, dropped = load_recording(*files, final_ids=False)
    assert (len(open_.detections), dropped.total) == (162, 0)
    assert np.sum(open_.detections.object_id == -1) == 1


def test_of_several_images_at_a_pose_the_nearest_is_whole(files, orbit):
    """An image 0.03 s late has two boxes: all of it is left out, or all of another."""

    def tenfold(lines):
        rows = (line.split(",", 1) for line in lines[1:])
        return [lines[0], *(f"{frame}0,{rest}" for frame, rest in rows)]

    edit(files[2], tenfold)
    time = orbit.times[3].item() + 0.03
    add_rows(files[2], *(f"35,{time!r},{x},5,{x + 9},14,0.9,1,cup,{x}" for x in (5, 50)))
    recording, dropped = load_recording(*files, ids="none")
    assert dropped.repeated == 2
    assert np.sum(recording.detections.pose == 3) == 4
    edit(files[2], lambda lines: [line for line in lines if not line.startswith("30,")])
    recording, dropped = load_recording(*files, ids="none")
    assert dropped.repeated == 0
    np.testing.assert_array_equal(
        recording.detections.box[recording.detections.pose == 3], [[5, 5, 14, 14], [50, 5, 59, 14]]
    )
