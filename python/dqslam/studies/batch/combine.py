"""The maps of a batch that are of one place: aligned with the first, and merged."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dqslam.places import CannotTellError, align, describe_alignment, merge
from dqslam.places.alignment import MotionName


@dataclass(frozen=True)
class AlignOptions:
    """How each map is aligned with the first one."""

    motion: MotionName = "auto"
    """As of ``places.align``."""
    sigma: float | None = None
    """Error of a center [m] in maps without covariances."""


@dataclass(frozen=True)
class MergeOptions(AlignOptions):
    """How all maps are merged in the frame of the first one."""


@dataclass(frozen=True)
class Combined:
    """What became of maps that were to be aligned or merged."""

    alignments: tuple[dict[str, Any], ...] = ()
    """An entry for each map but the first: its ``name`` and the content of ``alignment.json``, or
    ``not_aligned``, the reason why there is none."""
    merged: Path | None = None
    """The folder of the merged map; None if nothing was merged."""
    not_merged: str | None = None
    """The reason why maps that were to be merged are not."""

    @property
    def is_complete(self) -> bool:
        """Return whether everything was aligned and merged that was to be."""
        return self.not_merged is None and not any("not_aligned" in one for one in self.alignments)


def align_all(maps: list[Path], options: AlignOptions) -> tuple[dict[str, Any], ...]:
    """Align each map with the first one; maps are folders of results."""
    found = []
    for one in maps[1:]:
        try:
            alignment = align(one, maps[0], motion=options.motion, sigma=options.sigma)
        except CannotTellError as error:
            found.append({"name": one.name, "not_aligned": str(error)})
        else:
            described = describe_alignment(alignment, one.name, maps[0].name)
            found.append({"name": one.name, **described})
    return tuple(found)


def merge_all(maps: list[Path], out: Path, options: MergeOptions) -> str | None:
    """Merge maps into a folder; return why that is impossible, and None if it is done."""
    if len(maps) < 2:
        return "fewer than two recordings have a map with objects"
    try:
        merge(*maps, out=out, motion=options.motion, sigma=options.sigma)
    except CannotTellError as error:
        return str(error)
    return None
