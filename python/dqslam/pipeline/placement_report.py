"""What the report says of rules of where objects are."""

from __future__ import annotations

from typing import Any

import numpy as np

from dqslam.assumptions import PlacementRules
from dqslam.estimate import Estimate
from dqslam.placements import Placements

# Above this, objects of a table's size tell little more of their heights than without a plane.
WIDE_UP_DEG = 5.0


def describe_placements(
    placements: Placements, estimate: Estimate, rules: PlacementRules
) -> dict[str, Any]:
    """Say which planes were found, what is up, and which placements hold, in plain numbers."""
    up = placements.up
    names = dict(zip(estimate.object_ids.tolist(), estimate.class_names, strict=True))
    return {
        "up": list(rules.up or ()) if up is None else up.direction.tolist(),
        "up_sigma_deg": None if up is None else float(np.degrees(up.sigma)),
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
    """Say so where no rule, or less than half of them, holds, or up is hardly known."""
    if placements is None:
        return []
    rows, sigma = placements["placements"], placements.get("up_sigma_deg")
    if not rows:
        return ["no rule of placement holds for any object of the map"]
    warnings = []
    if sigma is not None and sigma > WIDE_UP_DEG:
        warnings.append(
            f"placements: the direction up is known to {sigma:.0f} degrees only; `up` in the file "
            "of the rules tells it"
        )
    holds = sum(row["holds"] for row in rows)
    if 2 * holds < len(rows):
        warnings.append(
            f"only {holds} of {len(rows)} placements hold: are the rules, and up, right?"
        )
    return warnings
