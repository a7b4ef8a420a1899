from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import oracle
from dqslam import (
    BoxNoise,
    Camera,
    Detections,
    Loss,
    Odometry,
    PoseModel,
    Recording,
    RelativePositions,
    ScenePriors,
    SizePrior,
    SizePriors,
    SolveOptions,
    _core,
    build_graph,
    load_scenario,
    simulate,
    solve,
)

CAMERA = Camera(500.0, 500.0, 319.5, 239.5, 640, 480)
BOXES = [[10.0, 10.0, 50.0, 110.0], [10.0, 10.0, 40.0, 50.0], [20.0, 20.0, 40.0, 50.0]]


def recording(**changes):
    """Three poses, three boxes of two objects, one relative position."""
    values = {
        "camera": CAMERA,
        "timestamps": [0.0, 1.0, 2.0],
        "odometry": Odometry(
            PoseModel.SE2,
            [1.0, 0.0, np.pi / 2.0],
            [[1.0, 0.0, 0.0], [2.0, 0.0, 0.1]],
            [np.diag([1.0, 2.0, 3.0]), np.eye(3)],
        ),
        "detections": Detections(
            pose=[0, 1, 2],
            box=BOXES,
            score=[1.0] * 3,
            class_id=[1, 0, 0],
            object_id=[30, 20, 30],
            class_names={0: "cup", 1: "bowl"},
        ),
        "positions": RelativePositions([2], [30], [[1.0, 2.0, 3.0]], [np.diag([4.0, 5.0, 6.0])]),
    }
    return Recording(**values | changes)


def test_graph_arrays_by_hand():
    prior = SizePrior(log_mean=-1.5, log_sigma=0.4)
    graph = build_graph(recording(), box_noise=BoxNoise(3.0, 0.1), size_prior=prior)
    core = graph.core
    np.testing.assert_array_equal(graph.object_ids, [20, 30])
    np.testing.assert_array_equal(graph.observations, [1, 2])
    np.testing.assert_allclose(
        core.initial_poses,
        [[1.0, 0.0, np.pi / 2.0], [1.0, 1.0, np.pi / 2.0], [1.0, 3.0, np.pi / 2.0 + 0.1]],
        atol=1e-12,
    )
    np.testing.assert_array_equal(
        np.column_stack([core.odometry.from_pose, core.odometry.to_pose]), [[0, 1], [1, 2]]
    )
    np.testing.assert_array_equal(core.odometry.covariance[0], [1, 0, 0, 0, 2, 0, 0, 0, 3])
    np.testing.assert_array_equal(core.boxes.pose, [0, 1, 2])
    np.testing.assert_array_equal(core.boxes.object, [1, 0, 1])
    np.testing.assert_array_equal(core.boxes.box, BOXES)
    # The first box is 40 px wide and 100 px high.
    expected = np.diag([9.0 + 16.0, 9.0 + 100.0, 9.0 + 16.0, 9.0 + 100.0])
    np.testing.assert_allclose(core.boxes.covariance[0].reshape(4, 4), expected)
    (positions,) = core.measurements
    assert positions.kind == "position"
    np.testing.assert_array_equal([positions.pose[0], positions.object[0]], [2, 1])
    np.testing.assert_array_equal(positions.covariance, [[4, 0, 0, 0, 5, 0, 0, 0, 6]])
    np.testing.assert_array_equal(core.size_prior.log_mean, [-1.5, -1.5])
    np.testing.assert_array_equal(core.size_prior.log_sigma, [0.4, 0.4])


def test_every_class_has_its_own_size_prior():
    bowl = SizePrior(log_mean=-2.0, log_sigma=0.1)
    other = SizePrior(log_mean=-1.0, log_sigma=0.9)
    boxes = replace(recording().detections, object_id=[30, 20, 20])  # a bowl, a cup
    graph = build_graph(
        recording(detections=boxes), size_prior=SizePriors({"bowl": bowl}, default=other)
    )
    assert graph.class_names == ("cup", "bowl")
    np.testing.assert_array_equal(graph.core.size_prior.log_mean, [-1.0, -2.0])
    np.testing.assert_array_equal(graph.core.size_prior.log_sigma, [0.9, 0.1])


def test_scene_priors_and_cut_edges_reach_the_core():
    cut = [[False] * 4, [True, False, False, True], [False] * 4]
    boxes = replace(recording().detections, truncated=cut)
    known = ScenePriors(upright_sigma=0.02, support_sigma=0.05, plane_offset=-0.5)
    core = build_graph(recording(detections=boxes), scene_priors=known).core
    np.testing.assert_array_equal(core.boxes.truncated, cut)
    priors = core.scene_priors
    assert (priors.upright_sigma, priors.support_sigma, priors.plane_offset) == (0.02, 0.05, -0.5)
    off = build_graph(recording()).core.scene_priors
    assert (off.upright_sigma, off.support_sigma, off.camera_height_sigma) == (0.0, 0.0, 0.0)


def test_an_objects_class_is_the_one_most_of_its_boxes_have():
    boxes = replace(
        recording().detections,
        object_id=[30, 30, 30],
        class_id=[1, 0, 0],
        class_names={0: "cup", 1: "bowl"},
    )
    assert build_graph(recording(detections=boxes, positions=None)).class_names == ("cup",)
    a_tie = build_graph(recording())
    assert a_tie.class_names == ("cup", "cup")  # the smaller class id


def test_positions_are_optional():
    assert not build_graph(recording(positions=None)).core.measurements


def without_id():
    return recording(detections=replace(recording().detections, object_id=[30, -1, 30]))


def without_boxes():
    return recording(detections=Detections([], [], [], [], []), positions=None)


def position_without_box():
    return recording(positions=replace(recording().positions, object_id=[31]))


@pytest.mark.parametrize(
    ("make", "settings", "message"),
    [
        (without_id, {}, r"detections\.object_id row 1: the box belongs to no object yet"),
        (without_boxes, {}, "detections: there are no boxes"),
        (position_without_box, {}, r"positions\.object_id row 0: the object has no box: 31"),
        (recording, {"box_noise": BoxNoise(pixels=0.0)}, "box noise: expected positive, finite"),
        (recording, {"box_noise": BoxNoise(pixels=np.nan)}, "box noise: expected positive, finite"),
        (recording, {"box_noise": BoxNoise(relative=-0.1)}, "box noise: relative is negative"),
        (
            recording,
            {"size_prior": SizePriors({"vase": SizePrior()})},
            "size priors: no class 'vase' in the recording, only: bowl, cup",
        ),
        (recording, {"size_prior": SizePrior(log_sigma=0.0)}, "log_size_sigma"),
        (recording, {"size_prior": SizePrior(log_mean=np.inf)}, "log_size_mean"),
    ],
)
def test_bad_problems_are_refused(make, settings, message):
    with pytest.raises(ValueError, match=message):
        build_graph(make(), **settings)


# --- solving -------------------------------------------------------------------------------------

# A size prior so broad that it moves nothing.
NO_PRIOR = {"box_noise": BoxNoise(1.0, 0.0), "size_prior": SizePrior(-1.0, 1e5)}


@cache
def noise_free():
    """A short arc round four ellipsoids, without any noise."""
    settings = load_scenario("paper").model_dump()
    settings["objects"] = "ellipsoids"
    settings["path"] |= {"length_m": 8.0, "width_m": 7.0, "laps": 1, "step_m": 0.3}
    settings["world"] |= {"object_count": 4, "side_sigma_m": 0.0}
    settings["detector"]["edge_sigma_px"] = 0.0
    recording, truth = simulate(type(load_scenario("paper")).model_validate(settings), seed=2)
    true = _core.between(PoseModel.SE2, truth.poses[:-1], truth.poses[1:])
    odometry = replace(recording.odometry, relative=true)
    return replace(recording, odometry=odometry, positions=None), truth


def test_a_noise_free_recording_is_recovered():
    recording, truth = noise_free()
    estimate, summary = solve(build_graph(recording, **NO_PRIOR))
    assert len(estimate.object_ids) == 4
    assert summary.final_cost < 1e-9
    np.testing.assert_allclose(estimate.poses, truth.poses, atol=1e-6)
    np.testing.assert_allclose(estimate.centers, truth.centers, atol=1e-6)
    true = np.array([_core.dual_quadric_from_ellipsoid(row) for row in truth.ellipsoids])
    np.testing.assert_allclose(estimate.dual_quadrics, true, atol=1e-6)
    assert estimate.is_ellipsoid.all()


def test_the_estimate_explains_the_boxes():
    """Sampled surfaces of the mapped objects, seen from the estimated poses, give the boxes."""
    recording, _ = noise_free()
    estimate, _ = solve(build_graph(recording, **NO_PRIOR))
    for row in range(0, len(recording.detections), 20):
        object_row = int(np.searchsorted(estimate.object_ids, recording.detections.object_id[row]))
        axes = _core.axes_from_ellipsoid(estimate.ellipsoids[object_row])
        box = oracle.bounding_box(
            recording.camera,
            oracle.se2_matrix(estimate.poses[recording.detections.pose[row]]),
            oracle.ellipsoid_surface(*axes),
        )
        np.testing.assert_allclose(box, recording.detections.box[row], atol=0.05)


def test_ellipsoids_far_from_the_origin_keep_their_digits():
    """The dual quadric holds c c^T - S: at 10^6 m nothing is left of the shape in it."""
    recording, truth = noise_free()
    away = np.array([1e6, -2e6, 0.0])
    odometry = replace(recording.odometry, first_pose=truth.poses[0] + away)
    estimate, _ = solve(build_graph(replace(recording, odometry=odometry), **NO_PRIOR))
    for row in range(4):
        _, axes, _ = _core.axes_from_ellipsoid(estimate.ellipsoids[row])
        _, true_axes, _ = _core.axes_from_ellipsoid(truth.ellipsoids[row])
        np.testing.assert_allclose(axes, true_axes, atol=1e-4)


def test_boxes_that_fit_are_told_from_those_that_do_not():
    recording, _ = noise_free()
    box = recording.detections.box.copy()
    box[[10, 50, 90]] += [0.0, 60.0, 0.0, 60.0]  # which no motion on the plane explains
    moved = replace(recording, detections=replace(recording.detections, box=box))
    graph = build_graph(moved, **NO_PRIOR | {"box_noise": BoxNoise(2.0, 0.0)})
    estimate, _ = solve(graph, SolveOptions(loss=Loss.CAUCHY))
    np.testing.assert_array_equal(np.flatnonzero(~estimate.inliers), [10, 50, 90])
    assert estimate.dropped == {}


def test_an_object_that_too_few_boxes_fit_is_dropped_with_a_robust_loss_only():
    """Two boxes of an object fit some ellipsoid, whatever they show: where boxes are wrong."""
    recording, _ = noise_free()
    detections = recording.detections
    last = np.flatnonzero(detections.object_id == detections.object_id.max())
    few = np.ones(len(detections), dtype=bool)
    few[last[2:]] = False
    part = replace(recording, detections=detections.select(few))
    priors = NO_PRIOR | {"size_prior": SizePrior(-1.0, 0.5)}
    assert len(solve(build_graph(part, **priors))[0].object_ids) == 4  # no box is wrong
    box = part.detections.box.copy()
    wrong = np.flatnonzero(part.detections.object_id == detections.object_id.min())[::5]
    assert len(wrong) > 0.01 * len(box)
    box[wrong] += 150.0
    part = replace(part, detections=replace(part.detections, box=box))
    graph = build_graph(part, **priors)
    assert len(solve(graph, SolveOptions(loss=Loss.NONE))[0].object_ids) == 4
    assert len(solve(graph)[0].object_ids) == 3
    estimate, _ = solve(graph, SolveOptions(loss=Loss.CAUCHY))
    gone = int(detections.object_id[last[0]])
    assert estimate.dropped == {gone: "seen in 2 poses by boxes that fit, 3 are needed"}
    assert estimate.object_ids.tolist() == [one for one in graph.object_ids if one != gone]
    assert len(estimate.ellipsoids) == len(estimate.class_names) == len(estimate.observations) == 3


def test_an_object_that_a_small_part_of_its_boxes_fits_is_dropped_too():
    """Four boxes of 13 fit: more than three views, but less than a third."""
    recording, _ = noise_free()
    detections = recording.detections
    last = np.flatnonzero(detections.object_id == detections.object_id.max())
    kept = np.ones(len(detections), dtype=bool)
    kept[last[13:]] = False
    box = detections.box.copy()
    box[last[4:13]] += np.random.default_rng(0).uniform(-200.0, 200.0, size=(9, 1))
    part = replace(recording, detections=replace(detections, box=box).select(kept))
    graph = build_graph(part, **NO_PRIOR | {"size_prior": SizePrior(-1.0, 0.5)})
    estimate, _ = solve(graph, SolveOptions(loss=Loss.CAUCHY))
    gone = int(detections.object_id[last[0]])
    assert estimate.dropped == {gone: "4 of 13 boxes fit, 5 are needed"}


def test_a_solve_can_start_where_another_ended():
    recording, truth = noise_free()
    graph = build_graph(recording, **NO_PRIOR)
    start = _core.State(truth.poses, truth.ellipsoids)
    estimate, summary = solve(graph, SolveOptions(max_iterations=3), start=start)
    assert summary.initial_cost < 1e-9
    np.testing.assert_allclose(estimate.poses, truth.poses, atol=1e-9)


def test_same_recording_same_bits():
    recording, _ = simulate(load_scenario("paper"), seed=4)
    once, again = (solve(build_graph(recording))[0] for _ in range(2))
    assert once.poses.tobytes() == again.poses.tobytes()
    assert once.dual_quadrics.tobytes() == again.dual_quadrics.tobytes()


def test_a_quadric_that_is_no_ellipsoid_is_nan_and_the_rest_is_kept():
    options = SolveOptions(
        residual=_core.Residual.ALGEBRAIC,
        landmark_model=_core.LandmarkModel.DUAL_QUADRIC,
        start=_core.Start.IDENTITY,
        schedule=_core.Schedule.BATCH,
        loss=Loss.NONE,
        max_iterations=1,
        algebraic_sigma=1e30,  # the boxes do not count: the quadrics stay at Q* = I
    )
    estimate, _ = solve(build_graph(recording()), options)
    assert np.isnan(estimate.ellipsoids).all()
    assert not estimate.is_ellipsoid.any()
    np.testing.assert_allclose(estimate.shapes[0] + np.eye(3), 0.0, atol=1e-3)  # S = -I
    np.testing.assert_array_equal(estimate.timestamps, [0.0, 1.0, 2.0])
    assert estimate.initial_poses.shape == (3, 3)
