"""The ids that a tracker gives to boxes, some of them wrong."""

import numpy as np
from numpy.random import Generator

from dqslam._checks import Floats, Ints
from dqslam.simulation.scenario import DetectorSettings


def associate(
    pose: Ints, object_row: Ints, center: Floats, settings: DetectorSettings, random: Generator
) -> Ints:
    """Return the object row of each detection (m,), some of them wrong.

    Every pair of pose and object has its own random numbers, whether it was detected or not. A
    wrong row is that of another detected object; if there is no other, all are right.

    Parameters
    ----------
    pose, object_row
        Pose and object of each detection, shape (m,).
    center
        True centers of all objects, meters, shape (o, 3).
    """
    size = (int(pose.max(initial=0)) + 1, len(center))
    is_wrong = random.random(size)[pose, object_row] < settings.wrong_associations
    which = random.random(size)[pose, object_row]
    said = object_row.copy()
    detected = np.unique(object_row)
    if len(detected) < 2:
        return said
    for row in np.flatnonzero(is_wrong):
        others = detected[detected != object_row[row]]
        if settings.wrong_association_kind == "structured":
            distance = np.linalg.norm(center[others] - center[object_row[row]], axis=1)
            said[row] = others[distance.argmin()]
        else:
            said[row] = others[int(which[row] * len(others))]
    return said


def switch_in_bursts(
    said: Ints, object_row: Ints, settings: DetectorSettings, random: Generator
) -> Ints:
    """Return the said rows (m,) with runs of boxes in a row that have another detected object's.

    The boxes of each object, in the order of time, are cut into runs of the burst's length, the
    first of which starts at random; each run is switched as a whole.

    Parameters
    ----------
    said, object_row
        What the ids say and what the boxes show, in the order of the poses, shape (m,).
    """
    switched = said.copy()
    detected = np.unique(object_row)
    if settings.burst_share == 0.0 or len(detected) < 2:
        return switched
    for shown in detected.tolist():
        rows = np.flatnonzero(object_row == shown)
        offset = int(random.integers(settings.burst_length))
        run = (np.arange(len(rows)) + offset) // settings.burst_length
        is_wrong = random.random(run[-1] + 1) < settings.burst_share
        others = detected[detected != shown]
        other = random.choice(others, size=run[-1] + 1)
        switched[rows] = np.where(is_wrong[run], other[run], said[rows])
    return switched
