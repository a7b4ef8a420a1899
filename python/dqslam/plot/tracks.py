"""What moves, in the map from above and over images: in black, for colors are those of the map."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.lens import recorded_pixels
from dqslam.metrics import Alignment
from dqslam.plot.above import FromAbove
from dqslam.track import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TRACK: dict[str, Any] = {"color": "0.1", "linewidth": 0.9, "linestyle": (0, (4, 1.5))}
TRACK_TAB = "#1a1a1a"  # of the name at its end
_MOST_ARROWS = 4  # along a track
_ARROW_EVERY = 0.1  # of the side of the window
# Edges of a cuboid join corners whose numbers differ in one binary digit.
_EDGES = [(a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit]


def draw_tracks(axes: "Axes", view: FromAbove, tracks: Sequence[Track], move: Alignment) -> None:
    """Draw the path of each track from above, and arrows along it; limits of axes must be set."""
    side = max(float(abs(np.diff(axes.get_xlim())[0])), float(abs(np.diff(axes.get_ylim())[0])))
    for track in tracks:
        path = view.points(move.apply(track.centers))
        axes.plot(*path.T, gid="track", zorder=2.8, **TRACK)
        length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        arrows = int(np.clip(length / (_ARROW_EVERY * side), 1, _MOST_ARROWS))
        for row in np.linspace(0, len(path) - 1, arrows + 1).round().astype(int)[1:]:
            before = path[max(row - 1, 0)]
            if np.linalg.norm(path[row] - before) > 0.0:
                axes.annotate(
                    "",
                    path[row],
                    before,
                    arrowprops={
                        "arrowstyle": "-|>",
                        "color": "0.1",
                        "lw": 0.6,
                        "mutation_scale": 6,
                    },
                    gid="track arrow",
                )


def track_ends(view: FromAbove, tracks: Sequence[Track], move: Alignment) -> list[Floats]:
    """Return the last place of each track from above, (2, 1), where its name belongs."""
    return [view.points(move.apply(track.centers[-1:])).T for track in tracks]


def draw_track_cuboids(
    axes: "Axes",
    camera: _core.Camera,
    world_from_camera: Floats,
    tracks: Sequence[Track],
    pose: int,
    scale: float,
) -> None:
    """Draw the cuboids of what moves into the image of a pose (7,), and their speeds.

    Cuboids that are not wholly in front of the camera are left out.
    """
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(world_from_camera[3:]).as_matrix()
    for track in tracks:
        (rows,) = np.nonzero(track.pose == pose)
        if not rows.size:
            continue
        seen = (track.corners()[rows[0]] - world_from_camera[:3]) @ turn
        if (seen[:, 2] <= 0.0).any():
            continue
        ideal = seen[:, :2] / seen[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
        pixels = recorded_pixels(camera, ideal)
        for first, last in _EDGES:
            axes.plot(
                *pixels[[first, last]].T, color="white", linewidth=1.0 * scale, gid="track cuboid"
            )
        speed = track.speeds[rows[0]]
        axes.annotate(
            f"T{track.track_id} {speed:.1f} m/s",
            (pixels[:, 0].min(), pixels[:, 1].min()),
            color="white",
            fontsize=6.5 * scale,
            clip_on=True,
        )
