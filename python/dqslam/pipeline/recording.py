"""A recording in memory, to a map, a trajectory and a report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam.association import FINAL, UNSURE
from dqslam.assumptions import SizePriors
from dqslam.calibration import find_clock_error
from dqslam.evaluation import common_poses
from dqslam.io import Trajectory
from dqslam.lens import camera_with, lens_of
from dqslam.pipeline.batch import estimate_batch
from dqslam.pipeline.border import with_cut_edges
from dqslam.pipeline.calibrated import check_estimated, estimate_calibrated
from dqslam.pipeline.clock import with_clock
from dqslam.pipeline.conclude import RunResult, conclude
from dqslam.pipeline.hold_out import choose_held_out
from dqslam.pipeline.lens import widened
from dqslam.pipeline.measurements import usable_measurements, with_measurements
from dqslam.pipeline.moving import with_tracks
from dqslam.pipeline.online import estimate_online
from dqslam.pipeline.options import Progress, RunOptions
from dqslam.pipeline.placements import with_placements
from dqslam.pipeline.problem import kept_problem, state_of
from dqslam.pipeline.shapes import with_shapes
from dqslam.recording import Recording


def run(
    recording: Recording,
    options: RunOptions | None = None,
    *,
    online: bool = False,
    reference: Trajectory | None = None,
    progress: Progress = lambda share, text: None,
) -> RunResult:
    """Estimate the poses and the objects of a recording, and report.

    Edges of boxes on the border of the image bound the object from one side only. Objects that do
    not fit a world at rest are left out; without any object, the odometry is returned as it is.
    The report warns of a recording without any box.
    Positions of objects, absolute positions and loop closures take part in a last estimate of all
    poses and objects, whose boxes are known by then. With absolute positions, the result is in
    their frame. Positions need final ids; measurements of other kinds take no part.
    With ``options.estimate``, camera, mount, clock or odometry are estimated with all else. The
    clock is looked for far from the times of the boxes first, and boxes without a pose at their
    time are left out then.

    Parameters
    ----------
    recording
        Its object ids are those of a tracker, -1 where a box has none.
    options
        What is chosen, by default ``RunOptions()``.
    online
        Whether the recording is replayed through an ``OnlineSlam`` as it would arrive, with a
        polish at the end; by default all of it is estimated at once.
    reference
        Trajectory to compare with, before and after: world_from_camera, in any world.
    progress
        Called with the share of the work that is done, 0 to 1, and, online, with a line on each
        step.

    Raises
    ------
    ValueError
        For ``online`` in mode MAPPING, an option out of range, an unknown parameter of the
        calibration, final ids that a box lacks, size priors of a class that is not in the
        recording, or a reference of another time.

    Examples
    --------
    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=0)
    >>> result = dq.run(recording, dq.RunOptions(hold_out=0.2))
    >>> result.estimate.centers.shape  # meters
    (8, 3)
    >>> result.report["reprojection"]["iou_median"] > 0.8
    True
    """
    options = options or RunOptions()
    if online and options.mode == _core.Mode.MAPPING:
        raise ValueError("online: a session improves the odometry, it has no mode MAPPING")
    if reference is not None:  # before the work: may they be compared?
        common_poses(recording.timestamps, reference)
    recording = with_cut_edges(recording)
    check_estimated(recording, options)
    camera = recording.camera
    recording, offset = widened(recording)
    boxes = recording.detections
    if isinstance(options.size_prior, SizePriors):
        options.size_prior.check_classes(set(boxes.class_names.values()))
    if options.trust_ids < FINAL or np.all(boxes.object_id < 0):
        options = replace(options, trust_ids=min(options.trust_ids, UNSURE))
    recording, remarks = usable_measurements(recording, options)
    estimator = estimate_online if online else estimate_batch
    recording, options, clock = with_clock(recording, options, estimator, progress)
    boxes = recording.detections
    if not len(boxes):
        remarks = ("there is no box: the trajectory is the odometry", *remarks)
    held_out = choose_held_out(len(boxes), options.hold_out, seed=options.seed)
    known = replace(recording, detections=boxes.select(~held_out))
    if options.estimate:
        output, calibrated = estimate_calibrated(known, options, estimator, progress)
        mount = calibrated.camera.robot_from_camera
        camera = (
            camera_with(camera, lens_of(camera), robot_from_camera=mount)
            if camera.has_distortion
            else calibrated.camera
        )
    else:
        bare = replace(known, positions=None, measurements=(), absolute=None, closures=None)
        calibrated = known
        output = with_measurements(estimator(bare, options, progress), known, options)
    output = clock.added_to(output)
    output = with_placements(with_shapes(output, calibrated, options), calibrated, options)
    output = with_tracks(output, replace(calibrated, detections=known.detections), options)
    output = replace(output, remarks=(*output.remarks, *remarks))
    graph = kept_problem(output, calibrated, options.mode)
    if graph is not None:
        output = replace(output, clock=find_clock_error(graph, state_of(output, graph)))
    # Boxes are judged as the calibration corrects them, and returned as they were given.
    shift = np.zeros((len(boxes), 4))
    shift[~held_out] = calibrated.detections.box - known.detections.box
    corrected = replace(boxes, box=boxes.box + shift)
    result = conclude(output, corrected, held_out, options, reference)
    shown = result.detections
    return replace(
        result,
        estimate=replace(result.estimate, camera=camera),
        detections=replace(shown, box=shown.box - shift - np.tile(offset, 2)),
        graph=graph,
    )
