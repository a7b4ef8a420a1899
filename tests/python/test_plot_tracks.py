"""What moves in the figure of the map: arrows by the length of a track, and legible names."""

import numpy as np
import pytest
from matplotlib.text import Text
from scipy.spatial.transform import Rotation

from dqslam.metrics import Alignment
from dqslam.plot.above import FromAbove
from dqslam.plot.labels import place_labels
from dqslam.plot.style import new_figure
from dqslam.plot.tracks import TRACK_TAB, draw_tracks, track_ends
from dqslam.track import Track

VIEW = FromAbove(np.eye(3)[:2], ("x [m]", "y [m]"), downward=False)
MOVE = Alignment(Rotation.from_euler("z", 90, degrees=True).as_matrix(), np.array([5.0, 0.0, 0.0]))


def straight(number, length, count=11, north=0.0):
    """Return a track along x."""
    centers = np.zeros((count, 3))
    centers[:, 0] = np.linspace(0.0, length, count)
    centers[:, 1] = north
    return Track(
        number,
        "car",
        "moves",
        0.999,
        np.arange(count),
        centers,
        np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        np.zeros(count),
        np.ones(count),
        np.zeros(count),
        np.full(count, True),
        np.array([4.0, 2.0, 1.5]),
        np.tile(1e-4 * np.eye(3), (count, 1, 1)),
        *np.full((3, count), 0.25),
        np.full(3, 0.1),
    )


@pytest.fixture
def axes():
    axes = new_figure(3.3, 3.3).subplots()
    axes.set(xlim=(0.0, 100.0), ylim=(0.0, 100.0))
    return axes


@pytest.mark.parametrize(("length", "arrows"), [(0.0, 0), (3.0, 1), (25.0, 2), (90.0, 4)])
def test_a_track_has_an_arrow_for_a_tenth_of_the_window(axes, length, arrows):
    draw_tracks(axes, VIEW, [straight(1, length)], MOVE)
    assert sum(one.get_gid() == "track arrow" for one in axes.texts) == arrows


def test_a_path_is_where_the_alignment_takes_it(axes):
    """Turned by 90 degrees, 30 m along x are 30 m along y, from (5, 0)."""
    draw_tracks(axes, VIEW, [straight(1, 30.0)], MOVE)
    path = axes.lines[0].get_xydata()
    np.testing.assert_allclose(path[[0, -1]], [[5.0, 0.0], [5.0, 30.0]], atol=1e-9)
    np.testing.assert_allclose(track_ends(VIEW, [straight(1, 30.0)], MOVE), [[[5.0], [30.0]]])


def test_names_of_tracks_side_by_side_do_not_cover_each_other(axes):
    tracks = [straight(number, 40.0, north=-number) for number in range(8)]
    ends = track_ends(VIEW, tracks, MOVE)
    names = [f"T{track.track_id}" for track in tracks]
    assert place_labels(axes, ends, names, [TRACK_TAB] * len(names), size=5.0) == 8
    axes.figure.draw_without_rendering()
    tabs = [Text.get_window_extent(one) for one in axes.texts]  # without lines and margins
    for row, tab in enumerate(tabs):
        assert not any(tab.overlaps(other) for other in tabs[:row])
