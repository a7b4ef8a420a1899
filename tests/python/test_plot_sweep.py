import json

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from dqslam.io import FileError
from dqslam.plot.sweep import draw_sweep, read_summary


def cell(values, median, interval):
    spread = {"median": median, "median_interval": interval}
    return {"values": values, "metrics": {"rmse_pos": spread}}


def summary(cells, parameters=("noise", "loss")):
    return {
        "parameters": list(parameters),
        "units": {"rmse_pos": "m"},
        "confidence": 0.95,
        "trials": 8,
        "cells": cells,
    }


GRID = summary(
    [
        cell({"noise": noise, "loss": loss}, noise / 10 + shift, [noise / 10, noise / 5 + shift])
        for loss, shift in (("none", 0.0), ("cauchy", 0.5))
        for noise in (4.0, 1.0, 2.0)
    ]
)


def drawn(axes):
    """Return, of each series, its label, points (n, 2) and bars (n, 2)."""
    found = {}
    for one in axes.containers:
        points = one.lines[0].get_xydata()
        (bars,) = one.lines[2]
        ends = np.array([segment[:, 1] for segment in bars.get_segments()])
        found[one.get_label()] = (points, ends, one.lines[0].get_linestyle())
    return found


def test_a_line_for_each_value_of_the_other_parameter():
    (axes,) = draw_sweep(GRID).axes
    series = drawn(axes)
    assert list(series) == ["loss none", "loss cauchy"]
    points, bars, line = series["loss cauchy"]
    np.testing.assert_allclose(points[:, 0], [1.0, 2.0, 4.0], atol=0.05)
    np.testing.assert_allclose(points[:, 1], [0.6, 0.7, 0.9])
    np.testing.assert_allclose(bars, [[0.1, 0.7], [0.2, 0.9], [0.4, 1.3]])
    assert line == "-"
    assert axes.get_ylabel() == "positions [m]"
    assert axes.get_title(loc="left") == "median of 8 trials, 95% intervals"


def test_names_are_side_by_side():
    (axes,) = draw_sweep(GRID, "loss").axes
    assert [one.get_text() for one in axes.get_xticklabels()] == ["none", "cauchy"]
    series = drawn(axes)
    assert list(series) == ["noise 4.0", "noise 1.0", "noise 2.0"]
    points, _, line = series["noise 1.0"]
    np.testing.assert_allclose(points[:, 0], [0.0, 1.0], atol=0.2)
    assert line == "None"


def test_a_wide_range_is_in_decades():
    cells = [cell({"noise": x}, x, None) for x in (0.01, 0.1, 1.0)]
    (axes,) = draw_sweep(summary(cells, ["noise"])).axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    ((points, bars, _),) = drawn(axes).values()
    np.testing.assert_allclose(points[:, 1], [0.01, 0.1, 1.0])
    np.testing.assert_allclose(np.diff(bars), 0.0, atol=1e-12)  # too few trials for an interval


def test_a_random_sample_is_a_cloud():
    random = np.random.default_rng(0).uniform(1.0, 2.0, (20, 2))
    cells = [cell({"noise": x, "loss": y}, x + y, None) for x, y in random]
    figure = draw_sweep(summary(cells))
    ((points, _, line),) = drawn(figure.axes[0]).values()
    np.testing.assert_allclose(points[:, 0], np.sort(random[:, 0]))
    assert line == "None"
    assert not figure.legends


def test_a_cell_without_the_metric_is_left_out():
    cells = [cell({"noise": 1.0}, 1.0, None), {"values": {"noise": 2.0}, "metrics": {}}]
    (axes,) = draw_sweep(summary(cells, ["noise"])).axes
    assert [len(points) for points, *_ in drawn(axes).values()] == [1]


def test_what_was_not_varied_is_refused():
    with pytest.raises(ValueError, match="nois was not varied; varied were noise, loss"):
        draw_sweep(GRID, "nois")


def test_a_summary_comes_from_its_file(tmp_path):
    (tmp_path / "summary.json").write_text(json.dumps(GRID))
    assert read_summary(tmp_path) == GRID


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", r"summary.json:1: not JSON"),
        ("3", r"summary.json: holds no table"),
        ("{}", r"summary.json: is not the summary of a sweep"),
    ],
)
def test_a_bad_summary_is_refused(tmp_path, text, message):
    (tmp_path / "summary.json").write_text(text)
    with pytest.raises(FileError, match=message):
        read_summary(tmp_path)
    with pytest.raises(FileError, match="cannot be read"):
        read_summary(tmp_path / "none")
