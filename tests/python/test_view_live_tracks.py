"""What moves on the live page: paths, and cuboids where an image shows them."""

import numpy as np
import pytest

from dqslam.view.live_tracks import LiveTracks
from dqslam.view.tracks import scene_tracks
from test_view_tracks import POSES, SIDES, made

viser = pytest.importorskip("viser", reason="viser is not installed")
PORT = 18120
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture
def server(capsys):
    with capsys.disabled():
        made_server = viser.ViserServer(port=PORT, verbose=False)
    yield made_server
    made_server.stop()


def test_cuboids_are_where_the_last_image_up_to_now_shows_them(server):
    track = made()
    live = LiveTracks(server, scene_tracks([track], {"cart": "#102030"}), UP)
    (cuboid,), (label,) = live.cuboids, live.labels
    assert not cuboid.visible
    np.testing.assert_allclose(cuboid.dimensions, SIDES)
    for frame, row in ((1, None), (2, 0), (4, 1), (7, 3), (8, None)):
        live.show(frame)
        assert cuboid.visible == label.visible == (row is not None)
        if row is None:
            continue
        np.testing.assert_allclose(cuboid.position, track.centers[row])
        x, y, z, w = track.orientations[row]
        np.testing.assert_allclose(cuboid.wxyz, [w, x, y, z])
        np.testing.assert_allclose(label.position, track.centers[row] + [0.0, 0.0, SIDES[2] / 2])
        assert label.text == f"cart T3, {track.speeds[row]:.1f} m/s"


def test_the_path_leads_through_all_centers(server):
    track = made()
    LiveTracks(server, scene_tracks([track], {"cart": "#102030"}), UP)
    (path,) = [
        node
        for name, node in server.scene._handle_from_node_name.items()
        if name == "/tracks/0/path"
    ]
    assert path.points.shape == (len(POSES) - 1, 2, 3)
    np.testing.assert_allclose(path.points[:, 0], track.centers[:-1], atol=1e-6)
    np.testing.assert_allclose(path.points[:, 1], track.centers[1:], atol=1e-6)
