"""A recording in files, to a map, a trajectory and a report, and these into a directory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from dqslam import _core, io
from dqslam._checks import Floats
from dqslam._files import write_text
from dqslam._outputs import output_set
from dqslam.association import FINAL
from dqslam.inspection import FATAL, find_jumps, first_findings
from dqslam.io.results import GRAPH_FILE, write_graph
from dqslam.io.results.save import write_estimate
from dqslam.pipeline.conclude import CLOCK, RunResult
from dqslam.pipeline.jumps import doubt_jumps
from dqslam.pipeline.options import Progress, RunFilesOptions
from dqslam.pipeline.problem import kept_options
from dqslam.pipeline.recording import run
from dqslam.places.landmarks import landmarks_of
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
        tracks.csv if anything moves, covariance.csv, camera.json, graph.npz, report.json, and
        manifest.json with their SHA-256. It must be new, empty, or of an earlier run, whose files
        all go at once when the new ones are there; by default nothing is written.
    beside
        Texts to write with them, by the names of their files.

    Raises
    ------
    ValueError
        For files that do not fit together, unless forced; for what ``run`` refuses; and for what is
        wrong in a file: ``io.FileError`` names the file and the line, or the directory that has
        files of others. Results that were there stay then, and no directory is left that was made
        for new ones.

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
    if options.strict and options.force:
        raise ValueError("strict: cannot be combined with force, which goes on in spite of it")
    _check_extras(options)
    inputs = (
        *(camera, odometry, detections, groundtruth, options.odometry_covariance),
        *vars(options.extras).values(),
    )
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
            _save(result, folder, beside or {}, options)
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
    options = replace(options, reading=options.reading.with_frame_times(odometry, detections))
    reference, reference_name = None, None
    if groundtruth is not None:
        reference, reference_name = io.read_trajectory(groundtruth, repeated_times=True), "file"
    elif options.added_noise is not None:
        quiet = io.Notes(max_bad=options.reading.max_bad)  # the same are said of the recording
        reference = io.read_path_file(odometry, options.reading, quiet)
        reference_name = "odometry before the added noise"
    says_noise = bool(options.believed_noise or options.odometry_covariance)
    notes = io.Notes(max_bad=options.reading.max_bad)
    doubts: list[str] = []
    remarks: list[str] = []
    recording, dropped, jumps = _load(files, options, notes, doubts, remarks)
    result = run(
        recording,
        replace(options, estimates_noise=options.estimates_noise or not says_noise),
        online=online,
        reference=reference,
        progress=progress,
    )
    estimate = result.estimate
    if any(told.startswith(CLOCK) for told in result.report["doubts"]):
        # A finished map tells clocks better than the first check.
        doubts = [told for told in doubts if not told.startswith(CLOCK)]
    doubts += doubt_jumps(landmarks_of(estimate), result.detections, estimate.timestamps, jumps)
    report = {
        "camera": str(camera),
        "odometry": str(odometry),
        "detections": str(detections),
        "groundtruth": None if groundtruth is None else str(groundtruth),
        **_describe(options),
        "dropped_boxes": asdict(dropped),
        "input_notes": notes.described(),
        "reference": reference_name,
        **result.report,
    }
    report["warnings"] = notes.sentences() + doubts + remarks + report["warnings"]
    report["doubts"] = doubts + report["doubts"]
    return replace(result, report=report)


def _check_extras(options: RunFilesOptions) -> None:
    """Refuse files of measurements that could take no part."""
    extras = options.extras
    of_poses = extras.absolute is not None or extras.closures is not None
    if options.mode == _core.Mode.MAPPING and of_poses:
        raise ValueError(
            "absolute positions and closures: mode MAPPING takes the poses for known, and has no "
            "use for them"
        )
    if extras.positions is not None and (options.ids == "none" or options.trust_ids != FINAL):
        raise ValueError("positions: the ids of boxes must be final, or objects are not known")


def _load(
    files: Sequence[str | Path],
    options: RunFilesOptions,
    notes: io.Notes,
    doubts: list[str],
    remarks: list[str],
) -> tuple[Recording, io.Dropped, Floats]:
    """Read a recording, add noise to it if need be, and count the boxes that were left out.

    The last are the times before jumps of the odometry, (j,) s.

    What readers left out is added to ``notes``, what speaks against the files to ``doubts``, or
    refused, and what may to ``remarks``.
    """
    jumps: list[float] = []

    def examine(camera: _core.Camera, trajectory: io.Trajectory, table: io.DetectionTable) -> None:
        found, noted = _examine(camera, trajectory, table, options)
        doubts.extend(found)
        remarks.extend(noted)
        odd = find_jumps(trajectory)
        jumps.extend(trajectory.timestamps[:-1][odd.jumps | odd.gaps].tolist())

    recording, dropped = io.load_recording(
        *files,
        min_score=options.min_score,
        ids=options.ids,
        final_ids=options.trust_ids == FINAL,
        odometry_noise=options.believed_noise,
        odometry_covariance=options.odometry_covariance,
        reading=options.reading,
        notes=notes,
        extras=options.extras,
        # Noise is added to every step: steps are then those of the file.
        interpolate=options.added_noise is None,
        examine=examine,
    )
    if options.added_noise is not None:
        noisy = perturb_odometry(recording, options.added_noise, seed=options.seed).odometry
        noisy = replace(noisy, covariance=recording.odometry.covariance)
        recording = replace(recording, odometry=noisy)
    return recording, dropped, np.array(jumps)


def _examine(
    camera: _core.Camera,
    trajectory: io.Trajectory,
    table: io.DetectionTable,
    options: RunFilesOptions,
) -> tuple[list[str], tuple[str, ...]]:
    """Return what speaks against the files, and notes; refuse what makes no map, unless forced."""
    if len(trajectory.timestamps) < 2:
        return [], ()  # refused later
    ids = None if options.ids == "none" or options.trust_ids != FINAL else options.ids
    latest = options.reading.max_time_difference
    findings, notes = first_findings(camera, trajectory, table, ids=ids, max_time_difference=latest)
    fatal = [str(one) for one in findings if options.strict or one.check in FATAL]
    if fatal and not options.force:
        way_on = "without --strict, the run goes on" if options.strict else "--force goes on"
        if options.strict and any(one.check in FATAL for one in findings):
            way_on = "--force instead of --strict goes on"
        raise ValueError(
            f"the files do not fit together: {'; '.join(fatal)}. `dqslam inspect` tells more, "
            f"{way_on}"
        )
    return [str(finding) for finding in findings], notes


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
        "measurements": {
            name: None if file is None else str(file)
            for name, file in asdict(options.extras).items()
        },
    }


def _save(
    result: RunResult, folder: Path, beside: Mapping[str, str], options: RunFilesOptions
) -> None:
    """Write all files of a result into an empty folder."""
    write_estimate(result.estimate, folder, result.detections, result.held_out, result.marginals)
    if result.graph is not None:
        solver = kept_options(options)
        write_graph(folder / GRAPH_FILE, result.graph, result.estimate, solver)
    io.write_json(folder / "report.json", result.report)
    for name, text in beside.items():
        write_text(folder / name, text)
