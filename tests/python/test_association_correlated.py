"""Least squares with errors that repeat, and the levels that are estimated with it."""

from dataclasses import replace

import numpy as np
import pytest

from dqslam import _core
from dqslam.association.all_images import estimate_all_images
from dqslam.association.between import predict_errors
from dqslam.association.correlated import CorrelatedProblem, minimize
from dqslam.association.earning import earns_it, gain_over_odometry, map_along_odometry
from dqslam.association.repetition import RepeatedNoise
from dqslam.association.variances import Levels, estimate_with_levels
from dqslam.assumptions import BoxNoise, OdometryNoise, SizePrior
from dqslam.graph import build_graph
from dqslam.subgraph import rebuilt
from repeated_errors import with_repeated_errors
from scenes import film, map_truly, orbit_poses, table_things

NOISE = OdometryNoise(0.01, 0.005)
NEW_PX, SHARE, ANGLE = 0.5, 0.04, 0.7


def make(noise=NOISE, seed=0, poses=60):
    made = film(orbit_poses(poses), table_things(6), noise=noise, noise_px=1e-3, seed=seed)
    return with_repeated_errors(
        made, new_px=NEW_PX, repeated_share=SHARE, angle=ANGLE, seed=seed + 100
    )


def lay_out(made):
    graph = build_graph(made.with_ids(), size_prior=SizePrior(float(np.log(0.06)), 0.7))
    mapped = _core.solve(graph.core, _core.SolveOptions(loss=_core.Loss.CAUCHY))
    state = _core.State(mapped.poses, mapped.landmarks)
    return CorrelatedProblem(graph.core), state


@pytest.fixture(scope="module")
def made():
    return make()


def test_the_gradient_and_the_hessian_are_those_of_the_cost(made):
    problem, state = lay_out(made)
    noise = RepeatedNoise()
    near = minimize(problem, state, noise, max_iterations=3)
    random = np.random.default_rng(0)
    aside = random.normal(size=len(near.gradient)) / np.sqrt(np.diag(near.hessian))
    state = problem.retract(near.state, 0.1 * aside)
    here = problem.linearize(state, noise)
    assert problem.cost(state, here) == pytest.approx(here.cost, rel=1e-12)
    for _ in range(5):
        step = random.normal(size=len(here.gradient))
        step *= 1e-3 / np.sqrt(step @ here.hessian @ step)
        ahead = problem.cost(problem.retract(state, step), here)
        back = problem.cost(problem.retract(state, -step), here)
        assert ahead - back == pytest.approx(2.0 * step @ here.gradient, rel=1e-3, abs=1e-6)
        assert ahead + back - 2.0 * here.cost == pytest.approx(1e-6, rel=0.02)


def test_an_object_that_its_boxes_leave_open_does_not_keep_the_others(made):
    """All edges of its boxes may be hidden, and the object extends beyond: they say nothing."""
    problem, state = lay_out(made)
    table = problem.graph.boxes
    own = table.object == 0
    box, truncated = table.box.copy(), table.truncated.copy()
    box[own] += 0.25 * (box[own, 2:] - box[own, :2])[:, [0, 1, 0, 1]] * [1.0, 1.0, -1.0, -1.0]
    truncated[own] = True
    boxes = _core.BoxTable(
        pose=table.pose,
        object=table.object,
        box=box,
        covariance=table.covariance,
        truncated=truncated,
    )
    found = minimize(
        CorrelatedProblem(rebuilt(problem.graph, boxes=boxes)),
        state,
        RepeatedNoise(),
        max_iterations=20,
    )
    start = 6 * (problem.graph.num_poses - 1)
    sigma = np.sqrt(np.diag(np.linalg.inv(found.hessian)))[start:].reshape(-1, 9)
    cameras = _core.world_from_camera(_core.PoseModel.SE3, problem.graph.camera, found.state.poses)
    away = np.linalg.norm(found.state.landmarks[0, :3] - cameras[table.pose[own], :3], axis=1)
    np.testing.assert_allclose(sigma[0, :3], np.median(away), rtol=1e-2)
    np.testing.assert_allclose(found.state.landmarks[0, :3], state.landmarks[0, :3], atol=1e-9)
    assert sigma[1:, :3].max() < 0.02 * np.median(away)
    assert made.ate(found.state.poses) < 0.5 * made.ate(made.odometry)


def test_levels_of_boxes_are_recovered(made):
    problem, state = lay_out(made)
    levels = Levels(RepeatedNoise(), None, np.zeros(0), np.ones(59), np.zeros(0))
    found = estimate_with_levels(problem, state, levels)
    # The tails that are allowed for take a part of normal errors for wider than they are.
    side = np.median(np.concatenate([boxes.side.ravel() for boxes in problem.objects]))
    new, repeated = levels.boxes.edge_variances(side)
    assert np.sqrt(new) == pytest.approx(NEW_PX, rel=0.35)
    assert np.sqrt(repeated) == pytest.approx(SHARE * side, rel=0.35)
    assert made.ate(found.state.poses) < 0.5 * made.ate(made.odometry)


def test_poses_are_better_than_with_errors_taken_for_new():
    """Over five seeds: the same problem, with all of the error believed to be new in each image."""
    ratio = []
    for seed in range(5):
        made = make(seed=seed)
        problem, state = lay_out(made)
        levels = Levels(RepeatedNoise(), None, np.zeros(0), np.ones(59), np.zeros(0))
        found = estimate_with_levels(problem, state, levels)
        white = RepeatedNoise(levels.boxes.total, BoxNoise(0.1, 1e-4))
        independent = minimize(problem, state, white, max_iterations=30)
        ratio.append(made.ate(found.state.poses) / made.ate(independent.state.poses))
    assert np.exp(np.mean(np.log(ratio))) < 0.8


def test_boxes_held_out_tell_a_path_that_is_better_from_one_that_is_not(made):
    problem, state = lay_out(made)
    noise = RepeatedNoise(BoxNoise(NEW_PX, 0.0), BoxNoise(0.1, SHARE), ANGLE)
    found = minimize(problem, state, noise, max_iterations=20)
    gain = gain_over_odometry(problem, found, noise)
    assert gain.shape == (6,)
    assert np.sum(gain > 0) >= 5
    assert earns_it(gain)
    # Exact odometry that is believed to be bad: boxes bend it, and others contradict that.
    exact = make(noise=None)
    problem, state = lay_out(exact)
    problem.odometry_precision *= 1e-4
    wrong = RepeatedNoise(BoxNoise(0.1, 1e-4), BoxNoise(0.1, 1e-4))
    bent = minimize(problem, state, wrong, max_iterations=20)
    gain = gain_over_odometry(problem, bent, wrong)
    assert not earns_it(gain)
    kept = map_along_odometry(problem, bent, noise)
    np.testing.assert_allclose(kept.poses, problem.graph.initial_poses, rtol=0, atol=1e-15)
    apart = np.linalg.norm(kept.landmarks[:, :3] - exact.centers, axis=1)
    assert apart.max() < 0.03


def test_nothing_is_said_of_a_single_object(made):
    problem, state = lay_out(made)
    alone = problem.part(np.arange(6) == 2)
    found = minimize(
        alone, _core.State(state.poses, state.landmarks[2:3]), RepeatedNoise(), max_iterations=5
    )
    gain = gain_over_odometry(alone, found, RepeatedNoise())
    assert np.isnan(gain).all()
    assert earns_it(gain)


def test_what_repeats_is_predicted_from_images_beside(made):
    problem, state = lay_out(made)
    noise = RepeatedNoise(BoxNoise(NEW_PX, 0.0), BoxNoise(0.1, SHARE), ANGLE)
    found = minimize(problem, state, noise, max_iterations=20)
    table = problem.graph.boxes
    cameras = _core.world_from_camera(
        problem.graph.pose_model, problem.graph.camera, found.state.poses
    )
    error, variance = predict_errors(
        problem, found, noise, cameras[table.pose], table.box, table.object
    )
    left = found.error - error
    assert left.std() < 0.25 * found.error.std()
    assert left.std() < 1.5 * NEW_PX
    side = np.tile(table.box[:, 2:] - table.box[:, :2], (1, 2))
    assert (variance >= NEW_PX**2 - 1e-9).all()
    assert (variance < NEW_PX**2 + 0.3 * (SHARE * side) ** 2 + 0.02).all()


def test_all_images_are_used_where_keyframes_are_few(made):
    scene = map_truly(made)
    keyframes = np.arange(0, 60, 6)
    ids = made.thing
    path = made.odometry[keyframes]
    objects = scene.ellipsoids
    final = estimate_all_images(made.recording, scene, keyframes, ids, path, objects)
    assert final.images.tolist() == list(range(60))
    assert not final.keeps_odometry
    assert made.ate(final.poses) < 0.5 * made.ate(made.odometry)
    assert final.pose_covariance.shape == (60, 6, 6)
    np.testing.assert_array_equal(final.pose_covariance[0], 0.0)
    errors = np.linalg.norm((final.poses - made.poses)[1:, :3], axis=1)
    expected = np.sqrt(np.trace(final.pose_covariance[1:, :3, :3], axis1=1, axis2=2))
    assert 0.3 < np.sqrt(np.mean((errors / expected) ** 2)) < 2.0


def test_images_between_those_estimated_together_are_better_than_bent_odometry(monkeypatch):
    made = make(poses=90)
    scene = map_truly(made)
    keyframes = np.arange(0, 90, 6)
    monkeypatch.setattr("dqslam.association.all_images.MOST_IMAGES", 20)
    start = made.poses[keyframes]
    together = estimate_all_images(
        made.recording, scene, keyframes, made.thing, start, scene.ellipsoids
    )
    assert together.images.tolist() == keyframes.tolist()
    monkeypatch.setattr(
        "dqslam.association.all_images.estimate_between",
        lambda recording, rows, images, path, *rest: path,
    )
    bent = estimate_all_images(
        made.recording, scene, keyframes, made.thing, start, scene.ellipsoids
    )
    between = np.setdiff1d(np.arange(90), keyframes)

    def local_error(poses):
        """Return how far the motions between successive poses are off, meters."""
        model = made.recording.odometry.pose_model
        moved = _core.between(model, poses[:-1], poses[1:])
        true = _core.between(model, made.poses[:-1], made.poses[1:])
        return float(np.sqrt(np.mean(_core.minus(model, moved, true)[:, :3] ** 2)))

    assert len(between) == 75
    assert local_error(together.poses) < 0.8 * local_error(bent.poses)


def test_too_many_keyframes_are_left_alone(monkeypatch, made):
    scene = map_truly(made)
    monkeypatch.setattr("dqslam.association.all_images.MOST_IMAGES", 25)
    keyframes = np.arange(60)
    arguments = (scene, keyframes, made.thing, made.poses, scene.ellipsoids)
    assert estimate_all_images(made.recording, *arguments) is None
    monkeypatch.setattr("dqslam.association.all_images.MOST_IMAGES", 30)
    final = estimate_all_images(made.recording, *arguments)
    assert final.images.tolist() == list(range(0, 60, 2))


def test_two_boxes_of_an_object_in_an_image_count_once(made):
    recording = made.with_ids()
    detections = recording.detections
    twice = replace(
        detections.select(np.r_[np.arange(len(detections)), 0]),
        object_id=np.append(detections.object_id, detections.object_id[0]),
    )
    graph = build_graph(replace(recording, detections=twice))
    problem = CorrelatedProblem(graph.core)
    boxes = problem.objects[int(graph.core.boxes.object[0])]
    assert len(np.unique(boxes.poses)) == len(boxes.poses)
