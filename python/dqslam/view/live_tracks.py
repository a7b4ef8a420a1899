"""What moves, on the live page: paths, and at each image the cuboids of what it shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam._checks import Floats
from dqslam.view.scene import rgb
from dqslam.view.tracks import SceneTrack

if TYPE_CHECKING:
    from viser import ViserServer

_PIXELS, _OPACITY = 2.0, 0.7


class LiveTracks:
    """The paths of tracks, and their cuboids with name and speed at one image."""

    def __init__(self, server: ViserServer, tracks: Sequence[SceneTrack], up: Floats) -> None:
        """Draw paths; cuboids are hidden until ``show``. ``up`` is a unit vector, (3,)."""
        self.group: Any = server.scene.add_frame("/tracks", show_axes=False)
        self.tracks, self.up = tracks, up
        self.cuboids: list[Any] = []
        self.labels: list[Any] = []
        for number, one in enumerate(tracks):
            centers, color = one.track.centers, rgb(one.color)
            segments = np.stack([centers[:-1], centers[1:]], axis=1)
            name = f"/tracks/{number}"
            server.scene.add_line_segments(
                f"{name}/path", segments, color, thickness=_PIXELS, thickness_units="screen"
            )
            length, width, height = one.track.sides.tolist()
            self.cuboids.append(
                server.scene.add_box(
                    f"{name}/cuboid",
                    color=color,
                    dimensions=(length, width, height),
                    opacity=_OPACITY,
                    visible=False,
                )
            )
            self.labels.append(
                server.scene.add_label(
                    f"{name}/label",
                    one.name_at(0),
                    visible=False,
                    anchor="bottom-center",
                    font_screen_scale=0.8,
                )
            )

    def show(self, frame: int) -> None:
        """Place the cuboids where they are at a pose; those that are not seen then are hidden."""
        for one, cuboid, label in zip(self.tracks, self.cuboids, self.labels, strict=True):
            row = one.row_at(frame)
            cuboid.visible = label.visible = row is not None
            if row is None:
                continue
            track = one.track
            cuboid.position, cuboid.wxyz = track.centers[row], track.orientations[row, [3, 0, 1, 2]]
            label.position = track.centers[row] + 0.5 * track.sides[2] * self.up
            label.text = one.name_at(row)
