"""Objects in a map whose size or shape is not to be believed."""

from types import SimpleNamespace

import numpy as np
import pytest

import dqslam as dq
from dqslam import Camera, Estimate, PoseModel, RunOptions, SizePrior, SizePriors, _core
from dqslam.io import load_results, save_estimate
from dqslam.pipeline.plausibility import find_doubtful
from dqslam.pipeline.report import describe_objects, warn_of_doubtful

BROAD = SizePrior(float(np.log(0.1)), 0.7)
CUP, BOOK = (0.05, 0.04, 0.04), (0.12, 0.08, 0.015)


def map_of(*objects, doubtful=None):
    """Objects by class and semi-axes, with ids from 10 on."""
    ellipsoids = np.array(
        [
            _core.ellipsoid_from_axes([float(row), 0, 5], np.array(axes), [0, 0, 0, 1])
            for row, (_, axes) in enumerate(objects)
        ]
    )
    poses = np.array([[0.0, 0, 0, 0, 0, 0, 1]])
    return Estimate(
        PoseModel.SE3,
        Camera(500.0, 500.0, 320.0, 240.0, 640, 480),
        timestamps=np.zeros(1),
        poses=poses,
        initial_poses=poses,
        object_ids=np.arange(10, 10 + len(objects)),
        class_names=tuple(name for name, _ in objects),
        observations=np.full(len(objects), 9),
        dual_quadrics=np.array([_core.dual_quadric_from_ellipsoid(one) for one in ellipsoids]),
        ellipsoids=ellipsoids,
        doubtful=doubtful or {},
    )


def books(*factors):
    return [("book", np.array(BOOK) * factor) for factor in factors]


def with_sigma(estimate, sigma):
    """Covariances of log-Cholesky shapes that are diagonal: sigma of each semi-axis's logarithm."""
    covariance = np.diag([1e-4] * 3 + [sigma**2] * 3 + [1e-8] * 3)
    return SimpleNamespace(objects=np.tile(covariance, (len(estimate.object_ids), 1, 1)))


def test_a_book_twice_and_a_half_as_large_as_the_others():
    """Factors 0.9 to 1.1 have a median of 1.0; the least spread is 0.25, three of it 2.12."""
    estimate = map_of(*books(0.9, 1.0, 1.1, 2.5, 1.0), ("cup", CUP))
    found = find_doubtful(estimate, BROAD, None)
    assert list(found) == [13]
    assert found[13].startswith("it is 0.6 x 0.4 x 0.075 m, its ")
    assert "axis 2.5 times the usual one of its class, by the 4 others" in found[13]
    assert find_doubtful(map_of(*books(0.9, 1.0, 1.1, 2.0)), BROAD, None) == {}
    # The book itself does not say what is usual, nor do two others.
    assert find_doubtful(map_of(*books(1.0, 1.0, 2.5)), BROAD, None) == {}


def test_classes_whose_members_differ_may_do_so():
    assert find_doubtful(map_of(*books(0.5, 0.7, 1.0, 1.5, 2.2)), BROAD, None) == {}


def test_a_needle_is_odd_whatever_it_is():
    """A teddy bear 3.65 m long and 0.12 m thick, among a cup, a mouse and books."""
    objects = [*books(1.0, 1.2), ("cup", CUP), ("mouse", (0.05, 0.03, 0.02)), ("cup", CUP)]
    estimate = map_of(*objects, ("teddy bear", (1.825, 0.065, 0.06)))
    (why,) = find_doubtful(estimate, BROAD, None).values()
    assert why.startswith("it is 3.6 x 0.13 x 0.12 m, its longest axis 36 times the usual one in ")
    assert why.endswith("by the 5 other objects: its boxes leave that open")
    # With too few others, the prior says so: 18 times 0.1 m is 4.1 of its sigmas.
    alone = map_of(("teddy bear", (1.825, 0.065, 0.06)))
    assert "times the usual one by the prior" in find_doubtful(alone, BROAD, None)[10]
    # What is known of its class makes it usual.
    known = SizePriors({"teddy bear": SizePrior(float(np.log(0.3)), 1.0)}, BROAD)
    assert find_doubtful(estimate, known, None) == {}


@pytest.mark.parametrize(
    ("sigma", "reason"),
    [(0.2, "its boxes show more than one thing, or it moved"), (0.5, "its boxes leave that open")],
)
def test_the_uncertainty_of_the_size_says_why(sigma, reason):
    """The logarithm of 2.5 is 0.92: 4.6 sigmas of 0.2, 1.8 of 0.5."""
    estimate = map_of(*books(1.0, 1.0, 1.0, 2.5))
    found = find_doubtful(estimate, BROAD, with_sigma(estimate, sigma))
    assert found[13].endswith(reason)


def test_what_is_no_ellipsoid_and_no_map_are_not_judged():
    estimate = map_of(*books(1.0, 1.0, 1.0, 2.5))
    estimate.ellipsoids[3] = np.nan
    assert find_doubtful(estimate, BROAD, None) == {}
    empty = map_of(("cup", CUP))
    none = Estimate(
        empty.pose_model,
        empty.camera,
        empty.timestamps,
        empty.poses,
        empty.poses,
        np.zeros(0, dtype=np.int64),
        (),
        np.zeros(0, dtype=np.int64),
        np.zeros((0, 9)),
        np.zeros((0, 9)),
    )
    assert find_doubtful(none, BROAD, None) == {}


def test_a_doubt_is_in_the_report_the_warnings_and_the_map(tmp_path):
    estimate = map_of(*books(1.0, 2.5), doubtful={11: "it is large"})
    assert warn_of_doubtful(estimate) == ["object 11 (book): it is large"]
    boxes = SimpleNamespace(object_id=np.zeros(0, dtype=np.int64))
    described = describe_objects(estimate, boxes, np.zeros(0), None)
    assert [entry["doubt"] for entry in described] == [None, "it is large"]
    save_estimate(estimate, tmp_path / "results")
    assert load_results(tmp_path / "results").objects.doubtful == {11: "it is large"}


def test_objects_of_an_orbit_are_plausible():
    recording, _ = dq.simulate(dq.load_scenario("orbit"), seed=0)
    result = dq.run(recording, RunOptions())
    assert len(result.estimate.object_ids) == 8
    assert result.estimate.doubtful == {}
