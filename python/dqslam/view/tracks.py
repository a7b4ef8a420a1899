"""What moves, as viewers show it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dqslam.track import Track


@dataclass(frozen=True, eq=False)
class SceneTrack:
    """Something that moves, in the world of the estimate."""

    track: Track
    color: str
    """``#rrggbb``, by class."""

    def row_at(self, frame: int) -> int | None:
        """Return the row of the last image that shows it up to a pose.

        None before the first of its images and after the last: where it is then is unknown.
        """
        pose = self.track.pose
        if not pose[0] <= frame <= pose[-1]:
            return None
        return int(np.searchsorted(pose, frame, side="right")) - 1

    def name_at(self, row: int) -> str:
        """Return its class, its number and its speed in one of its images."""
        one = self.track
        return f"{one.class_name} T{one.track_id}, {one.speeds[row]:.1f} m/s"


def scene_tracks(tracks: Sequence[Track], colors: Mapping[str, str]) -> tuple[SceneTrack, ...]:
    """Return tracks in the colors of their classes."""
    return tuple(SceneTrack(one, colors[one.class_name]) for one in tracks)
