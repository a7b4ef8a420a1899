"""The table of simulated streets: what is recognized, how large errors are, and how honest."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import typer

from benchmarks.tracks.street import KINDS, NOISE, Street, make_street
from dqslam._checks import Floats, Ints
from dqslam.tracks import estimate_tracks
from dqslam.uncertainty import normalized_squares

RIGHT = {"parked": "rests", "leaving": "stops and goes"}


@dataclass(frozen=True, eq=False)
class Outcome:
    """What was found of the thing of a street; errors are those of each image, (n,)."""

    behavior: str
    distance: Floats
    """Of the center, meters."""
    nees: Floats
    """Of the center: squared errors in sigmas, over 3."""
    speed: Floats
    """Error, meters per second."""
    speed_sigmas: Floats
    """The same in sigmas."""


def track_street(street: Street) -> Outcome:
    """Estimate the track of a street's thing, by the odometry and its covariance."""

    def joint(images: Ints) -> Floats:
        rows = (6 * images[:, None] + np.arange(6)).ravel()
        return np.asarray(street.path_covariance[np.ix_(rows, rows)])

    found = estimate_tracks(
        street.recording,
        street.path,
        street.ellipsoids,
        street.recording.detections.object_id - 1,
        final=True,
        box_noise=NOISE,
        path_covariance=joint,
    )
    none = np.zeros(0)
    if not found.tracks:
        return Outcome("rests" if found.resting else "unknown", none, none, none, none)
    (track,) = found.tracks
    error = track.centers - street.centers[track.pose]
    speed = track.speeds - street.speeds[track.pose]
    return Outcome(
        track.behavior,
        np.linalg.norm(error, axis=1),
        normalized_squares(error, track.center_covariances),
        np.abs(speed),
        speed / track.speed_sigmas,
    )


def tabulate(
    seeds: Annotated[int, typer.Option(min=1, help="Streets of each kind.")] = 20,
) -> None:
    """Simulate streets with a car that comes, goes ahead, crosses, leaves or is parked."""
    typer.echo("| car | recognized | position [m] median, 90 % | NEES | speed [m/s] | its NEES |")
    typer.echo("|---|---|---|---|---|---|")
    for kind in KINDS:
        found = [track_street(make_street(kind, seed)) for seed in range(seeds)]
        counts = Counter(one.behavior for one in found)
        right = counts[RIGHT.get(kind, "moves")]
        others = ", ".join(
            f"{count} {name}" for name, count in counts.items() if name != RIGHT.get(kind, "moves")
        )
        distance, nees, speed, sigmas = (
            np.concatenate([getattr(one, name) for one in found])
            for name in ("distance", "nees", "speed", "speed_sigmas")
        )
        numbers = "| | | | |"
        if len(distance):
            numbers = (
                f"| {np.median(distance):.2f}, {np.quantile(distance, 0.9):.2f} | "
                f"{nees.mean():.2f} | {np.median(speed):.2f} | {np.mean(sigmas**2):.2f} |"
            )
        note = f" ({others})" if others else ""
        typer.echo(f"| {kind} | {right} of {seeds}{note} {numbers}")
