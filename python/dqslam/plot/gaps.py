"""Lines that do not run where nothing is known."""

import numpy as np

from dqslam._checks import Floats

_GAP = 5.0  # times the usual interval


def break_at_gaps(timestamps: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return times (n,) and values (n, ...) with a row of NaN in each gap of time."""
    steps = np.diff(timestamps)
    usual = float(np.median(steps)) if len(steps) else 0.0
    gaps = np.flatnonzero(steps > _GAP * usual) + 1
    return np.insert(timestamps, gaps, np.nan), np.insert(values, gaps, np.nan, axis=0)
