"""A recording in files, to a map, a trajectory and a report, and these into a directory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from dqslam import io
from dqslam._files import write_text
from dqslam._outputs import output_set
from dqslam.association import FINAL
from dqslam.io.results.save import write_estimate
from dqslam.pipeline.conclude import RunResult
from dqslam.pipeline.options import Progress, RunFilesOptions
from dqslam.pipeline.recording import run
from dqslam.recording import Recording
from dqslam.simulation import perturb_odometry

WRITTEN_BY = "dqslam run"


def run_files(
    camera: str | Path,
    odometry: str | Path,
    detections: str | Path,
    options: RunFilesOptions | None = None,
    *,
    online: bool = False,
    groundtruth: str | Path | None = None,
    out: str | Path | None = None,
    beside: Mapping[str, str] | None = None,
    progress: Progress = lambda share, text: None,
) -> RunResult:
    """Estimate the trajectory and the objects of a recording in files, as ``dqslam run`` does.

    The report says what was chosen and which boxes were left out, too.

    Parameters
    ----------
    camera, odometry, detections
        Files in any of the formats of docs/formats.md. The odometry is a trajectory,
        world_from_camera in meters; boxes are in pixels of the image as it was recorded.
    options
        What is chosen, by default ``RunFilesOptions()``.
    online, progress
        As ``run`` has them.
    groundtruth
        TUM trajectory to compare with, in any world; by default the odometry before noise was added
        to it, if any was.
    out
        Directory to write the results into: trajectory.txt, odometry.txt, map.json, boxes.csv,
        covariance.csv, camera.json, report.json, and manifest.json with their SHA-256. It must be
        new, empty, or of an earlier run, whose files all go at once when the new ones are there;
        by default nothing is written.
    beside
        Texts to write with them, by the names of their files.

    Raises
    ------
    ValueError
        For what ``run`` refuses, and for what is wrong in a file: ``io.FileError`` names the file
        and the line, or the directory that has files of others. Results that were there stay then,
        and no directory is left that was made for new ones.

    Examples
    --------
    >>> import dqslam as dq
    >>> from dqslam import io
    >>> recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=0)
    >>> io.save_recording(recording, "recording")
    >>> files = [f"recording/{name}" for name in ("camera.json", "odometry.txt", "boxes.csv")]
    >>> result = dq.run_files(*files, dq.RunFilesOptions(ids="none"), out="results")
    >>> len(result.estimate.object_ids)
    8
    """
    options = options or RunFilesOptions()
    inputs = (camera, odometry, detections, groundtruth, options.odometry_covariance)
    whole = nullcontext() if out is None else output_set(out, WRITTEN_BY, inputs=inputs)
    with whole as folder:
        result = _run(
            (camera, odometry, detections),
            options,
            online=online,
            groundtruth=groundtruth,
            progress=progress,
        )
        if folder is not None:
            _save(result, folder, beside or {})
    return result


def _run(
    files: Sequence[str | Path],
    options: RunFilesOptions,
    *,
    online: bool,
    groundtruth: str | Path | None,
    progress: Progress,
) -> RunResult:
    """Estimate a recording in files, and describe where everything came from."""
    camera, odometry, detections = files
    if options.frames is None:
        times = io.choose_frame_times(odometry, detections, options.formats)
        options = replace(options, frames=times)
    reference, reference_name = None, None
    if groundtruth is not None:
        reference, reference_name = io.read_trajectory(groundtruth, repeated_times=True), "file"
    elif options.added_noise is not None:
        reference = io.read_trajectory(odometry, options.formats.trajectory, frames=options.frames)
        reference_name = "odometry before the added noise"
    says_noise = bool(options.believed_noise or options.odometry_covariance)
    recording, dropped = _load(files, options)
    result = run(
        recording,
        replace(options, estimates_noise=options.estimates_noise or not says_noise),
        online=online,
        reference=reference,
        progress=progress,
    )
    report = {
        "camera": str(camera),
        "odometry": str(odometry),
        "detections": str(detections),
        "groundtruth": None if groundtruth is None else str(groundtruth),
        **_describe(options),
        "dropped_boxes": asdict(dropped),
        "reference": reference_name,
        **result.report,
    }
    return replace(result, report=report)


def _load(files: Sequence[str | Path], options: RunFilesOptions) -> tuple[Recording, io.Dropped]:
    """Read a recording, add noise to it if need be, and count the boxes that were left out."""
    recording, dropped = io.load_recording(
        *files,
        min_score=options.min_score,
        ids=options.ids,
        final_ids=options.trust_ids == FINAL,
        max_time_difference=options.max_time_difference,
        odometry_noise=options.believed_noise,
        odometry_covariance=options.odometry_covariance,
        formats=options.formats,
        frames=options.frames,
    )
    if options.added_noise is not None:
        noisy = perturb_odometry(recording, options.added_noise, seed=options.seed).odometry
        noisy = replace(noisy, covariance=recording.odometry.covariance)
        recording = replace(recording, odometry=noisy)
    return recording, dropped


def _describe(options: RunFilesOptions) -> dict[str, Any]:
    """Say what was chosen of the ids and of the noise."""
    added, believed = options.added_noise, options.believed_noise
    covariance = options.odometry_covariance
    return {
        "min_score": options.min_score,
        "ids": options.ids,
        "trust_ids": None if options.ids == "none" else options.trust_ids,
        "odometry_noise_added": None if added is None else asdict(added) | {"seed": options.seed},
        "odometry_noise_believed": None if believed is None else asdict(believed),
        "odometry_covariance": None if covariance is None else str(covariance),
    }


def _save(result: RunResult, folder: Path, beside: Mapping[str, str]) -> None:
    """Write all files of a result into an empty folder."""
    write_estimate(result.estimate, folder, result.detections, result.held_out, result.marginals)
    io.write_json(folder / "report.json", result.report)
    for name, text in beside.items():
        write_text(folder / name, text)
