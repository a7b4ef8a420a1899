"""Labels: at their own outline, in its color, over no other label."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.colors import to_hex

from dqslam.plot.labels import place_labels
from dqslam.plot.style import column_style, new_figure

TURN = np.linspace(0, 2 * np.pi, 60)


def circle(x, y, radius):
    return np.stack([x + radius * np.cos(TURN), y + radius * np.sin(TURN)])


def labeled(outlines, texts, colors, size=6.0):
    """Return the labels on an empty square of 100 by 100."""
    with column_style():
        figure = new_figure(4.0, 4.0)
        axes = figure.subplots()
        axes.set(xlim=(0, 100), ylim=(0, 100), aspect="equal")
        count = place_labels(axes, outlines, texts, colors, size=size)
        figure.draw_without_rendering()
        boxes = {}
        for one in axes.texts:
            extent = one.get_bbox_patch().get_window_extent()
            boxes[one.get_text()] = axes.transData.inverted().transform(extent.get_points())
        assert count == len(axes.texts)
        inks = {one.get_text(): to_hex(one.get_bbox_patch().get_facecolor()) for one in axes.texts}
    return boxes, inks


def gap(box, outline):
    """Return the distance of a rectangle from the points of an outline."""
    low, high = box
    beyond = np.maximum(np.maximum(low - outline.T, outline.T - high), 0.0)
    return np.linalg.norm(beyond, axis=1).min()


def test_a_tab_touches_its_outline_and_no_other():
    """The upper object stands over the lower one's usual place for a name."""
    upper, lower = circle(50, 60, 15), circle(50, 35, 8)
    boxes, inks = labeled([upper, lower], ["driller 8", "can 6"], ["#cc79a7", "#e69f00"])
    assert inks == {"driller 8": "#cc79a7", "can 6": "#e69f00"}
    assert gap(boxes["driller 8"], upper) < 1.0
    assert gap(boxes["can 6"], lower) < 1.0
    assert gap(boxes["can 6"], upper) > 0.5


def test_names_of_many_do_not_cover_each_other_and_stay_in_the_frame():
    random = np.random.default_rng(0)
    outlines = [circle(*random.uniform(10, 90, 2), random.uniform(1, 4)) for _ in range(40)]
    texts = [f"thing {number}" for number in range(40)]
    boxes, _ = labeled(outlines, texts, ["#336699"] * 40, size=5.0)
    assert len(boxes) >= 38
    drawn = list(boxes.values())
    for row, (low, high) in enumerate(drawn):
        assert (low > -0.5).all() and (high < 100.5).all()
        for other_low, other_high in drawn[row + 1 :]:
            assert (np.minimum(high, other_high) - np.maximum(low, other_low)).min() < 0.7


def test_what_is_not_shown_or_has_no_place_has_no_label():
    assert not labeled([circle(150, 50, 5)], ["outside"], ["#000000"])[0]
    assert not labeled([circle(50, 50, 5)], ["far too long" * 20], ["#000000"])[0]
    assert not labeled([], [], [])[0]


def test_a_point_has_a_label_too():
    point = np.array([[50.0], [50.0]])
    boxes, _ = labeled([point], ["cross"], ["#000000"])
    assert gap(boxes["cross"], point) < 1.0
