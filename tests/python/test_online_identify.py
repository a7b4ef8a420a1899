"""Boxes of a session without ids: which objects they show, as they arrive and after a polish."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.problems import chain

import dqslam as dq
from dqslam.association.thinning import thin_recording
from dqslam.assumptions import BoxNoise, OdometryNoise
from dqslam.metrics import score_association
from dqslam.online import Motion, OnlineSlam, StepBoxes, StepError, replay, steps_of
from dqslam.online.commit import commit
from dqslam.online.integrated_odometry import IntegratedOdometry
from dqslam.online.local_map import local_map
from scenes import CAMERA, Film, Thing, film, orbit_poses, switched_ids, table_things
from test_association_consistency import circle

NOISE = OdometryNoise(0.02, 0.01)
BOXES = BoxNoise(1.0, 0.02)
ROBUST = dq.SolveOptions(loss=dq.Loss.CAUCHY, loss_scale=2.0)


def table(seed, turns=1.0, **options):
    """Film four cups and four books, with what detectors do wrong."""
    wrong = {"missed": 0.2, "false_positives": 0.5} | options
    return film(
        orbit_poses(round(40 * turns), turns), table_things(8), noise=NOISE, seed=seed, **wrong
    )


def session(made: Film, **options):
    options = {"box_noise": BOXES, "trust_ids": 0.9} | options
    return OnlineSlam(
        CAMERA,
        ROBUST,
        pose_model=dq.PoseModel.SE3,
        first_pose=made.recording.odometry.first_pose,
        **options,
    )


def followed(made: Film, recording=None, **options):
    slam = session(made, **options)
    for _ in replay(slam, recording or made.recording):
        pass
    return slam


def bits(slam):
    shown = np.concatenate(slam.assignments) if slam.assignments else np.zeros(0)
    return slam.poses.tobytes(), slam.objects.ellipsoids.tobytes(), shown.tobytes()


def score(made: Film, slam: OnlineSlam):
    """Compare what boxes are said to show with the truth; boxes are in the order of time."""
    shown = np.concatenate(slam.assignments)
    return score_association(made.recording.detections.pose, shown, made.thing)


def assert_found(made: Film, slam: OnlineSlam, *, recall):
    result = score(made, slam)
    assert (result.found, result.missed, result.invented, result.split) == (8, 0, 0, 0)
    assert result.purity >= 0.98
    assert result.recall >= recall
    assert slam.dropped == {}
    assert slam.num_objects == len(slam.objects) == 8


@pytest.mark.parametrize("seed", range(3))
def test_boxes_find_their_objects_as_they_arrive(seed):
    made = table(seed)
    slam = followed(made)
    result = score(made, slam)
    assert result.found == 8
    assert result.purity >= 0.95
    assert made.ate(slam.poses) < 0.5 * made.ate(made.odometry)
    slam.polish()
    assert_found(made, slam, recall=0.9)
    assert made.ate(slam.poses) < 0.5 * made.ate(made.odometry)
    for center in slam.objects.centers:
        assert np.linalg.norm(made.centers - center, axis=1).min() < 0.08


def test_objects_are_known_again_on_the_second_time_round():
    """120 keyframes: the first time round lies before what is looked at all the time."""
    made = table(2, turns=3.0, missed=0.1, false_positives=0.2)
    slam = followed(made)
    assert len(slam.keyframes) == 120
    slam.polish()
    assert_found(made, slam, recall=0.9)


def test_the_level_of_the_noise_is_estimated():
    """What the steps say of it is not believed."""
    made = table(0, turns=2.0)
    odometry = made.recording.odometry
    wrong = replace(odometry, covariance=1e-4 * odometry.covariance)
    slam = followed(made, replace(made.recording, odometry=wrong), estimates_noise=True)
    slam.polish()
    assert slam.odometry_noise.translation_m == pytest.approx(0.02, rel=0.5)
    assert slam.odometry_noise.rotation_rad == pytest.approx(0.01, rel=0.5)
    assert made.ate(slam.poses) < 0.5 * made.ate(made.odometry)


def test_ids_that_switch_are_cut_and_joined():
    made = table(0, false_positives=0.0)
    slam = followed(made, made.with_ids(switched_ids(made)))
    slam.polish()
    assert_found(made, slam, recall=0.9)


def test_ids_that_are_final_are_kept():
    made = table(0, false_positives=0.0)
    slam = followed(made, made.with_ids(), trust_ids=1.0)
    np.testing.assert_array_equal(np.concatenate(slam.assignments), made.thing)
    assert len(slam.keyframes) == 0


def test_what_moves_is_left_out_and_said():
    path = circle(0.5, 0.2 * np.linspace(0, 2 * np.pi, 40))
    mover = Thing(path[0], np.full(3, 0.05), class_id=2, path=path)
    made = film(orbit_poses(40), [*table_things(7), mover], noise=NOISE)
    slam = followed(made)
    slam.polish()
    assert slam.dropped
    shown = np.concatenate(slam.assignments)
    for number, why in slam.dropped.items():
        assert "it moved" in why
        assert set(made.thing[shown == number].tolist()) == {7}
        assert number not in slam.objects.object_ids
        assert slam.estimate().dropped[number] == why
    mapped = made.thing[np.isin(shown, slam.objects.object_ids)]
    assert set(range(7)) <= set(mapped.tolist())
    assert made.ate(slam.poses) < 0.5 * made.ate(made.odometry)


def test_the_same_steps_give_the_same_bits():
    made = table(4)
    assert bits(followed(made)) == bits(followed(made))


def test_what_arrives_during_a_polish_is_kept():
    made = table(1)
    slam = session(made)
    steps = list(steps_of(made.recording))
    for step in steps[:30]:
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
    work = slam.polish(background=True)
    for step in steps[30:]:
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
    work.result()
    slam.polish()
    assert len(slam) == 40
    assert_found(made, slam, recall=0.9)


def test_a_late_commit_overrules_nothing_that_has_changed_meanwhile():
    """A box, a tracklet and an object left out since stay; changes of the map are taken over."""
    state = followed(table(0))._state
    store = state.store
    local, before = local_map(state, 0), store.labels
    here, there = local.scene.labels, copy.deepcopy(before)
    mine, theirs, both = np.flatnonzero(before.object_rows == 0)[:3]
    here.release(np.array([mine, both]))
    here.dropped[2] = "it moved"
    here.object_of_tracklet[before.tracklets[mine]] = 1
    there.release(np.array([theirs]))
    there.cut_tracklet(np.array([both]))
    there.object_rows[both] = 3
    there.object_of_tracklet[before.tracklets[theirs]] = 3
    there.dropped = {4: "it moved, too"}
    store.labels = there
    commit(state, local)
    expected = before.object_rows.copy()
    expected[[mine, theirs, both]] = -1, -1, 3
    np.testing.assert_array_equal(store.labels.object_rows, expected)
    assert store.labels.object_of_tracklet[before.tracklets[mine]] == 1
    assert store.labels.object_of_tracklet[before.tracklets[theirs]] == 3
    np.testing.assert_array_equal(store.labels.tracklets, there.tracklets)
    assert set(store.labels.dropped) == {2, 4}
    assert before.object_rows[mine] == 0  # a snapshot keeps what it has


def test_an_object_that_is_joined_takes_its_earlier_boxes_along():
    """Boxes before the local map, whose object is given up in it, and their tracklets."""
    state = followed(table(0))._state
    store = state.store
    shown, own = store.labels.object_rows.copy(), store.labels.object_of_tracklet.copy()
    local = local_map(state, len(store.keyframes) - 5)
    assert (shown[: local.first_box] == 1).any()
    local.scene.labels.join_objects(0, 1)
    commit(state, local)
    np.testing.assert_array_equal(store.labels.object_rows, np.where(shown == 1, 0, shown))
    np.testing.assert_array_equal(store.labels.object_of_tracklet, np.where(own == 1, 0, own))
    assert state.core.observations[1] == 0
    assert store.labels.box_counts[0] == np.sum(shown <= 1) - np.sum(shown < 0)


def test_a_box_that_is_not_finite_is_named():
    slam = OnlineSlam(CAMERA, trust_ids=0.9)
    with pytest.raises(
        StepError, match=r"step 0: boxes row 1: NaN or infinite: \[1.0, nan, 3.0, 4.0\]"
    ):
        slam.add(None, StepBoxes([[1, 2, 3, 4], [1, np.nan, 3, 4]], [-1, -1]))


def test_a_bad_step_changes_nothing():
    made = table(0)
    steps = list(steps_of(made.recording))
    slam, other = session(made), session(made)
    for row, step in enumerate(steps[:20]):
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
        other.add(step.odometry, step.boxes, timestamp=step.timestamp)
        if row in (0, 5, 12):
            inverted = np.asarray(step.boxes.box)[:, [2, 1, 0, 3]]
            with pytest.raises(StepError, match=f"step {row + 1}: boxes row 0"):
                other.add(steps[row + 1].odometry, StepBoxes(inverted, step.boxes.object_id))
    assert bits(slam) == bits(other)


def test_boxes_with_ids_and_without_are_objects_of_their_own():
    made = table(0, false_positives=0.0, missed=0.0)
    half = np.where(made.thing < 4, made.thing, -1)
    slam = followed(made, made.with_ids(half), trust_ids=1.0)
    slam.polish()
    shown = np.concatenate(slam.assignments)
    np.testing.assert_array_equal(shown[half >= 0], half[half >= 0])
    result = score(made, slam)
    assert (result.found, result.missed, result.split) == (8, 0, 0)
    assert made.ate(slam.poses) < 0.5 * made.ate(made.odometry)


def test_a_saved_map_is_known_again_without_ids(tmp_path):
    made = table(1, false_positives=0.0, missed=0.0)
    first = followed(made)
    first.polish()
    first.save(tmp_path)
    again = table(5, missed=0.1)
    slam = OnlineSlam.load(
        tmp_path,
        ROBUST,
        pose_model=dq.PoseModel.SE3,
        first_pose=again.recording.odometry.first_pose,
        box_noise=BOXES,
    )
    for _ in replay(slam, again.recording):
        pass
    shown = np.concatenate(slam.assignments)
    result = score_association(again.recording.detections.pose, shown, again.thing)
    assert (result.found, result.invented, result.split) == (8, 0, 0)
    assert set(np.unique(shown[shown >= 0])) == set(first.objects.object_ids.tolist())
    assert again.ate(slam.poses) < 0.5 * again.ate(again.odometry)


@pytest.mark.parametrize("trust", [0.5, -1.0, 1.01, float("nan")])
def test_trust_out_of_range(trust):
    with pytest.raises(ValueError, match="trust in ids is .*, not above 0.5 and at most 1"):
        OnlineSlam(CAMERA, trust_ids=trust)


def test_integrated_odometry_is_what_thinning_makes_of_its_steps():
    """Two ways to the same motion and covariance: step by step, and from the whole path."""
    made = table(0)
    odometry = made.recording.odometry
    steps = IntegratedOdometry.of_no_steps(odometry.pose_model)
    for relative, covariance in zip(odometry.relative[:7], odometry.covariance[:7], strict=True):
        steps = steps.then(odometry.pose_model, relative, covariance)
    thin = thin_recording(made.recording, np.array([0, 7])).odometry
    np.testing.assert_allclose(steps.relative, thin.relative[0], atol=1e-12)
    as_given, per_translation, per_rotation = steps.covariances
    np.testing.assert_allclose(as_given, thin.covariance[0], rtol=1e-9, atol=1e-15)
    levels = 0.02**2 * per_translation + 0.01**2 * per_rotation
    np.testing.assert_allclose(levels, as_given, rtol=1e-9, atol=1e-15)


def test_a_drive_in_the_plane():
    """A turn and a half of the paper's loop: images of 10 keyframes or more before it closes."""
    recording, truth = dq.simulate(dq.load_scenario("paper"), seed=0)
    recording = replace(recording, positions=None)
    unknown = np.full(len(recording.detections), -1)
    unknown = replace(recording, detections=replace(recording.detections, object_id=unknown))
    slam = OnlineSlam(recording.camera, first_pose=recording.odometry.first_pose)
    for _ in replay(slam, unknown):
        pass
    slam.polish()
    order = np.argsort(recording.detections.pose, kind="stable")
    result = score_association(
        recording.detections.pose[order],
        np.concatenate(slam.assignments),
        recording.detections.object_id[order],
    )
    assert result.purity >= 0.9
    start = np.linalg.norm((slam.estimate().initial_poses - truth.poses)[:, :2], axis=1)
    error = np.linalg.norm((slam.poses - truth.poses)[:, :2], axis=1)
    assert error.mean() < 0.5 * start.mean()


def test_objects_of_a_loop_are_found_without_ids():
    """200 steps of 0.25 m from clean odometry; few objects are invented."""
    problem = chain(1, 10, 0, 0.1)
    detections = problem.recording.detections
    unknown = replace(detections, object_id=np.full(len(detections), -1))
    slam = OnlineSlam(problem.recording.camera, box_noise=BoxNoise(pixels=1.0, relative=0.0))
    for step in list(steps_of(replace(problem.recording, detections=unknown)))[:200]:
        slam.add(step.odometry, step.boxes)
    seen = detections.object_id[detections.pose < 200]
    assert len(np.unique(seen)) <= len(slam.objects) <= len(np.unique(seen)) + 3
    error = (slam.poses - problem.truth.poses[:200])[:, :2]
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.1


def test_motion_is_refused_as_with_ids():
    made = table(0)
    slam = session(made)
    step = next(steps_of(made.recording))
    slam.add(None, step.boxes)
    with pytest.raises(StepError, match="step 1: odometry"):
        slam.add(Motion(np.full(7, np.nan), np.eye(6)), step.boxes)
    assert len(slam) == 1
