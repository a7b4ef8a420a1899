"""Lines that are interrupted where data are missing."""

import numpy as np

from dqslam._checks import Floats

_GAP = 5.0  # a longer interval than this multiple of the usual one is a gap


def break_at_gaps(timestamps: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return times (n,) and values (n, ...), with a row of NaN inserted in each gap of time."""
    steps = np.diff(timestamps)
    usual = float(np.median(steps)) if len(steps) else 0.0
    gaps = np.flatnonzero(steps > _GAP * usual) + 1
    return np.insert(timestamps, gaps, np.nan), np.insert(values, gaps, np.nan, axis=0)
