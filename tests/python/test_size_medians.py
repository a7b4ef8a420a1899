"""The median size of objects as an unknown of the problem."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam._core import axes_from_ellipsoid
from dqslam.metrics import true_rows


@pytest.fixture(scope="module")
def drive():
    recording, truth = dq.simulate(dq.load_scenario("honest"), seed=3)
    return replace(recording, positions=None), truth


def unknown(median_m):
    return dq.SizePrior(float(np.log(median_m)), 0.7, float(np.log(10.0)))


def test_a_median_that_is_ten_times_wrong_is_corrected(drive):
    recording, truth = drive
    estimates = []
    for median in (0.03, 0.3, 3.0):
        graph = dq.build_graph(recording, size_prior=unknown(median))
        estimate, summary = dq.solve(graph)
        assert summary.converged
        estimates.append((estimate, median * np.exp(estimate.shared[0])))
    rows = true_rows(estimates[0][0].object_ids, truth)
    semi_axes = [axes_from_ellipsoid(each)[1] for each in truth.ellipsoids[rows]]
    true_median = np.exp(np.log(semi_axes).mean())
    for estimate, median in estimates:
        assert median == pytest.approx(true_median, rel=0.15)
        np.testing.assert_allclose(estimate.centers, estimates[1][0].centers, atol=0.02)


def test_each_prior_has_a_median_of_its_own_and_a_told_one_stays(drive):
    recording, _ = drive
    boxes = recording.detections
    ids = np.unique(boxes.object_id)
    kinds = {0: "small", 1: "large", 2: "told"}
    class_id = np.searchsorted(ids, boxes.object_id) % 3
    renamed = replace(boxes, class_id=class_id, class_names=kinds)
    priors = dq.SizePriors(
        {"small": unknown(0.1), "large": unknown(1.0), "told": dq.SizePrior(-1.0, 0.3)}
    )
    graph = dq.build_graph(replace(recording, detections=renamed), size_prior=priors)
    prior = graph.core.size_prior
    expected = {"small": np.log(0.1), "large": 0.0, "told": -1.0}
    for row, name in enumerate(graph.class_names):
        assert prior.log_mean[row] == pytest.approx(expected[name])
        assert (prior.shared[row] < 0) == (name == "told")
    assert len(graph.core.shared_sigma) == 2
    estimate, _ = dq.solve(graph)
    marginals = dq.marginal_covariances(graph, estimate)
    assert estimate.shared.shape == marginals.shared.shape == (2,)
    # Three objects with three semi-axes each: 0.7 / 3, a little more for their own errors.
    assert ((marginals.shared > 0.2) & (marginals.shared < 0.4)).all()


def test_the_default_is_unknown_and_numbers_are_told(drive):
    recording, _ = drive
    graph = dq.build_graph(recording)
    np.testing.assert_array_equal(graph.core.shared_sigma, [dq.UNKNOWN_SIZE.median_log_sigma])
    np.testing.assert_array_equal(graph.core.size_prior.shared, np.zeros(graph.core.num_objects))
    told = dq.build_graph(recording, size_prior=dq.SizePrior(-1.0, 0.3))
    assert len(told.core.shared_sigma) == 0
    estimate, _ = dq.solve(told)
    assert len(estimate.shared) == 0


def test_a_table_may_leave_a_median_open(tmp_path):
    path = tmp_path / "sizes.toml"
    path.write_text("[classes.chair]\nmedian_m = 0.4\nspread = 1.5\nmedian_spread = 2\n")
    assert dq.load_size_priors(path).of("chair").median_log_sigma == pytest.approx(np.log(2.0))
