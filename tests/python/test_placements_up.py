"""The direction up, from objects that stand on planes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam import _core
from dqslam.metrics import true_rows
from dqslam.placements.lowest_points import (
    gradients_by_objects,
    lowest_points,
    support_points,
    tilt_between,
    turned,
)
from dqslam.placements.up import Supported, estimate_up
from dqslam.uncertainty import normalized_squares

RADIUS = 0.1


def spheres(centers, radius=RADIUS):
    """An estimate of spheres, seen by no camera."""
    count = len(centers)
    log_cholesky = np.array([np.log(radius)] * 3)
    ellipsoids = np.zeros((count, 9))
    ellipsoids[:, :3] = centers
    unit = _core.ellipsoid_from_dual_quadric(
        _core.dual_quadric_from_ellipsoid(np.zeros(9))
    )  # the parameters of the unit sphere
    ellipsoids[:, 3:] = unit[3:]
    ellipsoids[:, 3:6] += log_cholesky
    assert np.allclose(_core.ellipsoid_shapes(ellipsoids), radius**2 * np.eye(3))
    return dq.Estimate(
        pose_model=dq.PoseModel.SE3,
        camera=dq.Camera(500.0, 500.0, 320.0, 240.0, 640, 480),
        timestamps=np.zeros(1),
        poses=np.array([[0, 0, 0, 0, 0, 0, 1.0]]),
        initial_poses=np.array([[0, 0, 0, 0, 0, 0, 1.0]]),
        object_ids=np.arange(count),
        class_names=("thing",) * count,
        observations=np.full(count, 9),
        dual_quadrics=np.array([_core.dual_quadric_from_ellipsoid(e) for e in ellipsoids]),
        ellipsoids=ellipsoids,
    )


def of_centers(count, sigma):
    """A covariance of independent centers (9 count, 9 count), in which shapes are known."""
    return np.kron(np.eye(count), np.diag([sigma**2] * 3 + [1e-12] * 6))


TRUE = turned(np.array([0.0, 0.0, 1.0]), np.array([0.1, -0.05, 0.0]))
FLAT = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [0.3, 0.6], [2, 0.4]])


def on_a_plane(flat=FLAT, height=0.7):
    axes = np.linalg.qr(np.column_stack([TRUE, np.eye(3)[:, :2]]))[0][:, 1:]
    return flat @ axes.T + (height + RADIUS) * TRUE


def one_plane(count, sigma=0.01):
    return [Supported(np.arange(count), sigma, True)]


def test_tilts_by_hand():
    z, x = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    assert turned(z, 0.5 * np.pi * x) == pytest.approx(x, abs=1e-15)
    assert tilt_between(z, x) == pytest.approx(0.5 * np.pi * x)
    assert tilt_between(z, z) == pytest.approx(np.zeros(3))
    assert dq.UpDirection.with_sigma(2 * z, 0.1).sigma == pytest.approx(0.1)


def test_the_lowest_point_of_a_sphere():
    estimate = spheres([[1.0, 2.0, 3.0]])
    assert lowest_points(estimate, TRUE) == pytest.approx(TRUE @ [1.0, 2.0, 3.0] - RADIUS)
    assert support_points(estimate, TRUE)[0] == pytest.approx([1, 2, 3] - RADIUS * TRUE)
    gradient = gradients_by_objects(estimate, TRUE)[0]
    assert gradient[:3] == pytest.approx(TRUE)
    # All axes larger by a factor: the lowest point moves by that share of the radius.
    assert gradient[3:6].sum() == pytest.approx(-RADIUS)


def test_the_lowest_point_of_a_cuboid_is_a_corner():
    turn = np.array([0.3, -0.2, 0.5])
    half = np.array([0.1, 0.2, 0.3])
    plain = spheres([[0.0, 0.0, 1.0]])
    landmark = np.concatenate([[0.0, 0.0, 1.0], np.log(half), turn])[None]
    estimate = replace(plain, object_shapes=(dq.Shape.CUBOID,), landmarks=landmark)
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = Rotation.from_rotvec(turn).apply(signs * half) + [0.0, 0.0, 1.0]
    lowest = corners[np.argmin(corners @ TRUE)]
    assert lowest_points(estimate, TRUE) == pytest.approx(lowest @ TRUE)
    assert support_points(estimate, TRUE)[0] == pytest.approx(lowest, abs=1e-6)
    gradient = gradients_by_objects(estimate, TRUE)[0]
    assert gradient[:3] == pytest.approx(TRUE)
    away = Rotation.from_rotvec(turn).inv().apply(lowest - [0.0, 0.0, 1.0])
    normal = Rotation.from_rotvec(turn).inv().apply(TRUE)
    assert gradient[3:6] == pytest.approx(away * normal)  # each half-length by its share


def test_up_and_its_covariance_in_closed_form():
    centers, prior_sigma, sigma, rule = on_a_plane(), 0.2, 0.02, 0.01
    prior = dq.UpDirection.with_sigma(TRUE, prior_sigma)
    found = estimate_up(spheres(centers), of_centers(6, sigma), one_plane(6, rule), prior)
    assert found.direction == pytest.approx(TRUE, abs=1e-6)
    # A line through heights, seen from the side: horizontal offsets from the mean tell the slope.
    offsets = centers - centers.mean(axis=0)
    information = offsets.T @ offsets / (sigma**2 + rule**2)
    flat = np.linalg.qr(np.column_stack([TRUE, np.eye(3)[:, :2]]))[0][:, 1:]
    expected = np.linalg.inv(flat.T @ information @ flat + np.eye(2) / prior_sigma**2)
    assert flat.T @ found.covariance @ flat == pytest.approx(expected, rel=1e-3)
    assert found.covariance @ TRUE == pytest.approx(np.zeros(3), abs=1e-9)


def test_a_poor_prior_and_things_on_top_of_others_do_not_matter():
    centers = on_a_plane()
    centers[1] += 0.3 * TRUE  # stands on something
    prior = dq.UpDirection.with_sigma([0.0, -0.25, 1.0], 0.35)
    found = estimate_up(spheres(centers), of_centers(6, 0.005), one_plane(6), prior)
    assert np.degrees(np.arccos(found.direction @ TRUE)) < 0.3
    assert found.sigma < np.deg2rad(2.0)


def test_two_planes_of_one_direction():
    centers = np.vstack([on_a_plane(), on_a_plane(FLAT[:4] + 3.0, 0.2)])
    prior = dq.UpDirection.with_sigma([0.0, 0.0, 1.0], 0.35)
    found = estimate_up(spheres(centers), of_centers(10, 0.005), one_plane(10), prior)
    assert np.degrees(np.arccos(found.direction @ TRUE)) < 0.1


def test_without_a_plane_nothing_is_known_but_the_prior():
    prior = dq.UpDirection.with_sigma([0.0, 0.0, 1.0], 0.1)
    centers = np.array([[0.0, 0, 0], [1, 0, 5]])  # two objects make no plane
    found = estimate_up(spheres(centers), of_centers(2, 0.01), one_plane(2), prior)
    assert found.direction == pytest.approx([0, 0, 1])
    assert found.covariance == pytest.approx(prior.covariance)


def test_other_planes_that_fit_as_well_are_in_the_covariance():
    # Three of four objects make a plane in two ways that are alike in a mirror.
    tilted = 0.25
    centers = np.array([[-1.0, 0, -tilted], [1, 0, -tilted], [0, 1, 0], [0, -1, 0]])
    prior = dq.UpDirection.with_sigma([0.0, 0.0, 1.0], 0.3)
    found = estimate_up(spheres(centers), of_centers(4, 0.002), one_plane(4), prior)
    away = np.arccos(found.direction[2])
    assert away == pytest.approx(np.arctan(tilted), abs=0.03)
    assert found.sigma > 0.7 * away


@pytest.fixture(scope="module")
def looks():
    """Short looks at tables with up wrong by some 10 degrees: true rows, estimates, what is up."""
    orbit = dq.load_scenario("orbit")
    path = orbit.path.model_copy(update={"turns": 0.15, "poses": 20})
    world = orbit.world.model_copy(update={"lift_max_m": 0.0})
    random, found = np.random.default_rng(0), []
    for seed in range(8):
        recording, truth = dq.simulate(
            orbit.model_copy(update={"path": path, "world": world}), seed=seed
        )
        graph = dq.build_graph(replace(recording, positions=None))
        tilt = np.append(random.normal(0.0, np.deg2rad(10.0), 2), 0.0)
        up = tuple(turned(np.array([0.0, 0.0, 1.0]), tilt).tolist())
        wrong = dq.PlacementRules((dq.PlacementRule("on", None, "plane", 0.005),), up)
        free = replace(wrong, up_sigma=np.deg2rad(10.0))
        found.append((truth, graph, [dq.solve_with_placements(graph, r) for r in (wrong, free)]))
    return found


def test_up_is_estimated_with_the_map(looks):
    tilts, scores, centers, nees = [], [], [], []
    for truth, _, ((_, wrong, _, _), (placed, right, _, found)) in looks:
        assert found.up is not None
        marginals = dq.placed_covariances(placed, right, found)
        known = dq.marginal_covariances(placed, right)
        assert np.all(np.trace(marginals.centers - known.centers, axis1=1, axis2=2) > 0)
        assert np.all(marginals.shared >= known.shared)
        tilts.append(np.degrees(np.arccos(found.up.direction[2])))
        flat = found.up.direction[:2]
        scores.append(flat @ np.linalg.solve(found.up.covariance[:2, :2], flat) / 2)
        errors = []
        for each in (wrong, right):
            off = each.centers - truth.centers[true_rows(each.object_ids, truth)]
            errors.append(np.linalg.norm(off, axis=1).mean())
        centers.append(errors)
        nees.append(normalized_squares(off, marginals.centers).mean())
    assert np.mean(tilts) < 2.0
    assert np.mean(scores) < 1.5
    before, after = np.mean(centers, axis=0)
    assert after < 0.9 * before
    assert np.mean(nees) < 1.5


def test_up_that_is_told_is_exact(looks):
    for _, _, ((placed, estimate, _, found), _) in looks[:1]:
        assert found.up is None
        known = dq.marginal_covariances(placed, estimate)
        assert np.array_equal(dq.placed_covariances(placed, estimate, found).objects, known.objects)
