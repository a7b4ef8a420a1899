"""What the report says of rules of where objects are."""

from __future__ import annotations

from typing import Any

from dqslam.estimate import Estimate
from dqslam.placements import Placements


def describe_placements(placements: Placements, estimate: Estimate) -> dict[str, Any]:
    """Say which planes were found, and which placements hold, in plain numbers."""
    names = dict(zip(estimate.object_ids.tolist(), estimate.class_names, strict=True))
    return {
        "planes": [
            {
                "height_m": plane.height,
                "sigma_m": plane.sigma,
                "object_ids": plane.object_ids.tolist(),
            }
            for plane in placements.planes
        ],
        "placements": [
            {"kind": kind, "object": one, "class_name": names[one], "other": other, "holds": fits}
            for kind, one, other, fits in zip(
                placements.kinds,
                placements.object_ids.tolist(),
                [None if other < 0 else other for other in placements.other_ids.tolist()],
                placements.holds.tolist(),
                strict=True,
            )
        ],
    }


def warn_of_placements(placements: dict[str, Any] | None) -> list[str]:
    """Say so where no rule, or less than half of them, holds."""
    if placements is None:
        return []
    rows = placements["placements"]
    if not rows:
        return ["no rule of placement holds for any object of the map"]
    holds = sum(row["holds"] for row in rows)
    if 2 * holds >= len(rows):
        return []
    return [f"only {holds} of {len(rows)} placements hold: are the rules, and up, right?"]
