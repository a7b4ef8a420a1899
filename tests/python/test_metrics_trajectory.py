import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oracle
import realdata
from dqslam.io import nearest_pose, read_trajectory
from dqslam.metrics import (
    absolute_trajectory_error,
    align_poses,
    align_positions,
    align_rigid,
    center_errors,
    relative_pose_error,
)

RANDOM = np.random.default_rng(5)


@pytest.mark.parametrize("size", [2, 3])
def test_alignment_undoes_a_rigid_motion(size):
    points = RANDOM.normal(size=(12, size))
    turned = oracle.quaternion_matrix([0.6, 0.0, 0.0, 0.8])  # about x
    turn = turned if size == 3 else turned[1:, 1:]
    moved = points @ turn.T + np.arange(size)
    alignment = align_rigid(points, moved)
    np.testing.assert_allclose(alignment.rotation, turn, atol=1e-12)
    np.testing.assert_allclose(alignment.translation, np.arange(size), atol=1e-12)
    np.testing.assert_allclose(alignment.apply(points), moved, atol=1e-12)


@pytest.mark.parametrize("size", [2, 3])
def test_alignment_never_mirrors_nor_scales(size):
    points = RANDOM.normal(size=(12, size))
    mirrored = 3.0 * points * np.array([-1.0, 1.0, 1.0])[:size]
    rotation = align_rigid(points, mirrored).rotation
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(size), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_alignment_is_the_best_of_its_neighbors():
    points = RANDOM.normal(size=(30, 3))
    target = points + 0.3 * RANDOM.normal(size=(30, 3))
    alignment = align_rigid(points, target)
    least = np.sum((alignment.apply(points) - target) ** 2)
    for _ in range(50):
        xyzw = np.append(0.02 * RANDOM.normal(size=3), 1.0)
        turn = oracle.quaternion_matrix(xyzw / np.linalg.norm(xyzw))
        shift = 0.02 * RANDOM.normal(size=3)
        assert np.sum((alignment.apply(points) @ turn.T + shift - target) ** 2) > least


def test_alignment_of_a_straight_line_still_fits():
    line = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)])
    moved = line[:, [2, 0, 1]] + 1.0
    np.testing.assert_allclose(align_rigid(line, moved).apply(line), moved, atol=1e-12)


TRUE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def test_trajectory_error_by_hand():
    error = absolute_trajectory_error(
        TRUE + [[0, 0, 1], [0, 0, 2], [0, 0, 3], [0, 0, 6]], TRUE, align="none"
    )
    assert (error.mean, error.median, error.max) == (3.0, 2.5, 6.0)
    assert error.rmse == pytest.approx(np.sqrt((1 + 4 + 9 + 36) / 4.0))
    np.testing.assert_array_equal(error.alignment.rotation, np.eye(3))


def test_se2_alignment_keeps_heights():
    turned = TRUE @ oracle.quaternion_matrix([0, 0, 0.6, 0.8]).T + [5.0, 6.0, 2.0]
    on_plane = absolute_trajectory_error(turned, TRUE, align="se2")
    assert on_plane.mean == pytest.approx(2.0)
    assert absolute_trajectory_error(turned, TRUE, align="se3").max == pytest.approx(0.0, abs=1e-12)


def test_object_centers_use_the_trajectorys_alignment():
    turn = oracle.quaternion_matrix([0, 0, 0.6, 0.8])
    alignment = absolute_trajectory_error(TRUE @ turn.T + 7.0, TRUE).alignment
    true_centers = np.array([[3.0, 4.0, 5.0], [0.0, 0.0, 0.0]])
    centers = (true_centers + [[0.0, 0.0, 0.5], [1.0, 0.0, 0.0]]) @ turn.T + 7.0
    np.testing.assert_allclose(center_errors(centers, true_centers, alignment), [0.5, 1.0])


@pytest.mark.parametrize(
    ("points", "true_points", "align", "message"),
    [
        (TRUE, TRUE[:3], "se3", r"differ in shape: \(4, 3\), \(3, 3\)"),
        (TRUE[:0], TRUE[:0], "se3", "no points to compare"),
        (TRUE[:1], TRUE[:1], "se3", "expected two points or more, got 1"),
        (TRUE[:, :2], TRUE[:, :2], "se3", r"expected shape \(n, 3\), got \(4, 2\)"),
        (TRUE * np.nan, TRUE, "se3", "estimated points row 0: not finite"),
        (TRUE * 0.0, TRUE, "sim3", "the points do not move, so that they have no scale"),
        (TRUE, TRUE, "rigid", '"none", "se2", "se3" or "sim3", got \'rigid\''),
    ],
)
def test_bad_trajectories_are_refused(points, true_points, align, message):
    with pytest.raises(ValueError, match=message):
        absolute_trajectory_error(points, true_points, align=align)


# --- a scale, and whole poses ---------------------------------------------------------------------


def poses_of(positions, rotations):
    return np.column_stack([positions, rotations.as_quat()])


def wander(count, seed, straight=False):
    """Walk at random, or along a line, and look around."""
    random = np.random.default_rng(seed)
    steps = [1.0, 0.0, 0.0] if straight else random.normal(size=(count, 3))
    positions = np.cumsum(np.broadcast_to(steps, (count, 3)), axis=0)
    turns = Rotation.from_rotvec(np.cumsum(0.1 * random.normal(size=(count, 3)), axis=0))
    return poses_of(positions, turns)


def moved(poses, turn, shift, scale=1.0):
    """Move poses by hand."""
    return poses_of(
        scale * turn.apply(poses[:, :3]) + shift, turn * Rotation.from_quat(poses[:, 3:])
    )


def disturbed(poses, seed, meters=0.1, radians=0.05):
    random = np.random.default_rng(seed)
    turns = Rotation.from_quat(poses[:, 3:])
    turns *= Rotation.from_rotvec(radians * random.normal(size=(len(poses), 3)))
    return poses_of(poses[:, :3] + meters * random.normal(size=(len(poses), 3)), turns)


TURN = Rotation.from_rotvec([0.3, -0.7, 1.1])


def test_similarity_finds_the_scale():
    points = RANDOM.normal(size=(20, 3))
    alignment = align_positions(points, 2.5 * TURN.apply(points) + [1, 2, 3], "sim3")
    assert alignment.scale == pytest.approx(2.5)
    np.testing.assert_allclose(alignment.rotation, TURN.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(alignment.translation, [1, 2, 3], atol=1e-12)


def test_similarity_is_the_best_of_its_neighbors():
    points = RANDOM.normal(size=(30, 3))
    target = 0.5 * points + 0.3 * RANDOM.normal(size=(30, 3))
    alignment = align_positions(points, target, "sim3")
    least = np.sum((alignment.apply(points) - target) ** 2)
    middle = alignment.apply(points).mean(axis=0)
    for scale in (0.99, 1.01):
        around = scale * (alignment.apply(points) - middle) + middle
        assert np.sum((around - target) ** 2) > least


@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize("kind", ["se3", "sim3"])
def test_poses_undo_a_motion(kind, straight):
    scale = 2.5 if kind == "sim3" else 1.0
    poses = wander(15, seed=1, straight=straight)
    true = moved(poses, TURN, [1, 2, 3], scale)
    found = align_poses(poses, true, kind, lever=2.0)
    np.testing.assert_allclose(found.rotation, TURN.as_matrix(), atol=1e-9)
    assert found.scale == pytest.approx(scale)
    np.testing.assert_allclose(found.apply(poses[:, :3]), true[:, :3], atol=1e-9)
    turned = found.apply_poses(poses)
    between = Rotation.from_quat(turned[:, 3:]).inv() * Rotation.from_quat(true[:, 3:])
    np.testing.assert_allclose(between.magnitude(), 0.0, atol=1e-9)


def test_poses_on_the_plane_turn_about_z_only_and_keep_heights():
    turn = Rotation.from_rotvec([0, 0, 0.8])
    poses = wander(15, seed=1)
    found = align_poses(poses, moved(poses, turn, [1, 2, 3]), "se2", lever=2.0)
    np.testing.assert_allclose(found.rotation, turn.as_matrix(), atol=1e-9)
    np.testing.assert_allclose(found.translation, [1, 2, 0], atol=1e-9)


def test_poses_give_the_motion_that_fits_points_ahead_of_the_cameras_best():
    """Umeyama on the seven points of each pose, written out, is the same motion."""
    lever = 3.0
    true = wander(20, seed=2)
    poses = disturbed(true, seed=3, meters=0.5, radians=0.3)

    def points(poses):
        turns = Rotation.from_quat(poses[:, 3:]).as_matrix()
        ahead = [poses[:, :3] + lever * sign * turns[:, :, k] for sign in (-1, 1) for k in range(3)]
        return np.concatenate([poses[:, :3], *ahead])

    expected = align_rigid(points(poses), points(true))
    found = align_poses(poses, true, lever=lever)
    np.testing.assert_allclose(found.rotation, expected.rotation, atol=1e-12)
    np.testing.assert_allclose(found.translation, expected.translation, atol=1e-12)


def test_a_straight_path_does_not_let_the_map_turn_about_it():
    """The positions leave the turn about the line to noise; the poses do not."""
    true = wander(50, seed=4, straight=True)
    poses = disturbed(true, seed=5, meters=0.01, radians=0.01)
    beside = np.array([[25.0, 10.0, 0.0]])
    by_positions = center_errors(beside, beside, align_positions(poses[:, :3], true[:, :3]))
    by_poses = center_errors(beside, beside, align_poses(poses, true, lever=10.0))
    assert by_positions[0] > 0.3
    assert by_poses[0] < 0.05


@pytest.mark.parametrize("lever", [0.0, -1.0, np.nan])
def test_a_lever_is_a_length(lever):
    with pytest.raises(ValueError, match="lever: expected a positive distance"):
        align_poses(wander(5, 0), wander(5, 0), lever=lever)


# --- relative pose error --------------------------------------------------------------------------


def test_relative_error_by_hand():
    """Two steps of 1 m; the estimate takes 2 m and 1 m, and turns by 0.1 and 0.3 rad about z."""
    true = poses_of([[0, 0, 0], [1, 0, 0], [2, 0, 0]], Rotation.identity(3))
    turns = Rotation.from_rotvec([[0, 0, 0], [0, 0, 0.1], [0, 0, 0.4]])
    second = [2 + np.cos(0.1), np.sin(0.1), 0]
    found = relative_pose_error(poses_of([[0, 0, 0], [2, 0, 0], second], turns), true)
    assert found.pairs == 2
    assert found.translation.max == pytest.approx(1.0)
    assert found.translation.mean == pytest.approx(0.5)
    assert found.translation.rmse == pytest.approx(np.sqrt(0.5))
    assert found.rotation_deg.max == pytest.approx(np.degrees(0.3))
    assert found.rotation_deg.median == pytest.approx(np.degrees(0.2))


def test_relative_error_does_not_see_the_world_frame():
    true = wander(30, seed=1)
    poses = disturbed(true, seed=2)
    here, there = (relative_pose_error(p, true) for p in (poses, moved(poses, TURN, [9, 9, 9])))
    assert here.translation.rmse == pytest.approx(there.translation.rmse, rel=1e-12)
    assert here.rotation_deg.rmse == pytest.approx(there.rotation_deg.rmse, rel=1e-9)


def test_pairs_by_frames_and_meters():
    """Positions 0, 1, 3, 6, 10 m: 3 m or more apart are (0, 2), (1, 3), (2, 3) and (3, 4)."""
    true = poses_of([[x, 0, 0] for x in (0, 1, 3, 6, 10)], Rotation.identity(5))
    off = true.copy()
    off[:, 1] = [0, 1, 2, 4, 8]
    apart = relative_pose_error(off, true, delta=3, unit="meters")
    assert (apart.pairs, apart.translation.mean) == (4, pytest.approx((2 + 3 + 2 + 4) / 4))
    chained = relative_pose_error(off, true, delta=3, unit="meters", all_pairs=False)
    assert (chained.pairs, chained.translation.mean) == (3, pytest.approx((2 + 2 + 4) / 3))
    frames = relative_pose_error(off, true, delta=2)
    assert (frames.pairs, frames.translation.mean) == (3, pytest.approx((2 + 3 + 6) / 3))
    assert relative_pose_error(off, true, delta=2, all_pairs=False).pairs == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"delta": 30}, "no two poses are 30 frames apart"),
        ({"delta": 1e6, "unit": "meters"}, r"no two poses are 1e\+06 meters apart"),
        ({"delta": 0}, "delta: expected a positive number, got 0"),
        ({"delta": 1.5}, "delta: expected a whole number of frames, got 1.5"),
        ({"unit": "feet"}, 'expected "frames" or "meters", got \'feet\''),
    ],
)
def test_bad_pairs_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        relative_pose_error(wander(30, 0), wander(30, 0), **arguments)


# --- against evo ----------------------------------------------------------------------------------


def evo_path(times, poses):
    trajectory = pytest.importorskip("evo.core.trajectory")
    wxyz = poses[:, [6, 3, 4, 5]]
    return trajectory.PoseTrajectory3D(poses[:, :3].copy(), wxyz.copy(), times)


def desk():
    """Return times, estimated and true poses of a real recording."""
    folder = realdata.recording("tum_fr2_desk")
    times, poses = read_trajectory(folder / "odometry_orbslam2_rgbd.txt")
    true = read_trajectory(folder / "groundtruth_mocap_100hz.txt", repeated_times=True)
    row, late = nearest_pose(true.timestamps, times)
    near = late < 0.01
    return times[near], poses[near], true.world_from_camera[row[near]]


def synthetic():
    true = wander(200, seed=7)
    drifted = disturbed(true, seed=8)
    return np.arange(200.0), moved(drifted, TURN, [4, 5, 6], 1.3), true


@pytest.mark.parametrize("recording", [synthetic, desk])
@pytest.mark.parametrize("align", ["none", "se3", "sim3"])
def test_absolute_error_is_that_of_evo(recording, align):
    metrics = pytest.importorskip("evo.core.metrics")
    times, poses, true = recording()
    path, true_path = evo_path(times, poses), evo_path(times, true)
    if align != "none":
        path.align(true_path, correct_scale=align == "sim3")
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((true_path, path))
    found = absolute_trajectory_error(poses[:, :3], true[:, :3], align=align)
    expected = ape.get_all_statistics()
    for name in ("rmse", "mean", "median", "max"):
        assert getattr(found, name) == pytest.approx(expected[name], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("recording", [synthetic, desk])
def test_absolute_error_on_the_plane_is_that_of_evo(recording):
    """With flat trajectories evo's alignment in space is one on the plane."""
    metrics = pytest.importorskip("evo.core.metrics")
    times, poses, true = recording()
    poses = align_positions(poses[:, :3], true[:, :3]).apply_poses(poses)
    poses[:, 2] = true[:, 2] = 0.0
    path, true_path = evo_path(times, poses), evo_path(times, true)
    path.align(true_path)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((true_path, path))
    found = absolute_trajectory_error(poses[:, :3], true[:, :3], align="se2")
    assert found.rmse == pytest.approx(ape.get_statistic(metrics.StatisticsType.rmse), rel=1e-9)


@pytest.mark.parametrize("recording", [synthetic, desk])
@pytest.mark.parametrize(
    ("delta", "unit", "all_pairs"),
    [(1, "frames", True), (7, "frames", True), (7, "frames", False), (1.5, "meters", False)],
)
def test_relative_error_is_that_of_evo(recording, delta, unit, all_pairs):
    metrics = pytest.importorskip("evo.core.metrics")
    times, poses, true = recording()
    found = relative_pose_error(poses, true, delta=delta, unit=unit, all_pairs=all_pairs)
    units = metrics.Unit.frames if unit == "frames" else metrics.Unit.meters
    # evo takes angles from traces of matrices: a few digits are lost near zero.
    relations = {
        metrics.PoseRelation.translation_part: (found.translation, 1e-9),
        metrics.PoseRelation.rotation_angle_deg: (found.rotation_deg, 1e-7),
    }
    for relation, (ours, tolerance) in relations.items():
        rpe = metrics.RPE(relation, delta, units, all_pairs=all_pairs, pairs_from_reference=True)
        rpe.process_data((evo_path(times, true), evo_path(times, poses)))
        expected = rpe.get_all_statistics()
        assert found.pairs == len(rpe.error)
        for name in ("rmse", "mean", "median", "max"):
            assert getattr(ours, name) == pytest.approx(
                expected[name], rel=tolerance, abs=tolerance
            )
