from dataclasses import replace

import numpy as np
import pytest

from dqslam import build_graph, load_scenario, plot_maps, simulate, solve
from dqslam.plot.maps import _outline, _true_outlines, _window


def area(outline):
    x, y = outline
    return 0.5 * abs(np.dot(x[:-1], y[1:]) - np.dot(x[1:], y[:-1]))


def test_an_outline_from_above_is_the_shadow_of_the_ellipsoid():
    shape = np.diag([0.25, 0.04, 9.0])
    outline = _outline(np.array([1.0, 2.0, 3.0]), shape)
    np.testing.assert_allclose(outline.min(axis=1), [0.5, 1.8])
    np.testing.assert_allclose(outline.max(axis=1), [1.5, 2.2])
    assert area(outline) == pytest.approx(np.pi * 0.5 * 0.2, rel=0.01)


@pytest.fixture(scope="module")
def maps():
    made = []
    for objects in ("cubes", "ellipsoids"):
        scenario = load_scenario("paper").model_copy(update={"objects": objects})
        recording, truth = simulate(scenario, seed=6)
        estimate, _ = solve(build_graph(recording))
        made.append((objects, estimate, truth))
    return made


def test_a_true_cube_is_a_disc_of_its_volume(maps):
    _, _, truth = maps[0]
    radius = np.sqrt([area(outline) / np.pi for outline in _true_outlines(truth)])
    np.testing.assert_allclose(4.0 / 3.0 * np.pi * radius**3, truth.volumes, rtol=0.01)


def test_true_ellipsoids_are_drawn_where_they_are(maps):
    _, _, truth = maps[1]
    middle = [outline[:, :-1].mean(axis=1) for outline in _true_outlines(truth)]
    np.testing.assert_allclose(middle, truth.centers[:, :2], atol=1e-9)


def test_the_window_holds_the_truth_and_is_not_blown_up_by_a_diverged_estimate(maps):
    _, estimate, truth = maps[0]
    far = replace(estimate, poses=estimate.poses + 1e6)
    low, high = _window([("far", far, truth)])
    assert (low < truth.poses[:, :2].min(axis=0)).all()
    assert (high > truth.poses[:, :2].max(axis=0)).all()
    assert (high - low < [40.0, 40.0]).all()


@pytest.mark.parametrize("count", [1, 2, 4])
def test_any_number_of_maps(tmp_path, maps, count):
    plot_maps((maps * 2)[:count], tmp_path / "maps.png")
    assert (tmp_path / "maps.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_nothing_to_draw_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no maps to draw"):
        plot_maps([], tmp_path / "maps.png")
    assert not (tmp_path / "maps.png").exists()
