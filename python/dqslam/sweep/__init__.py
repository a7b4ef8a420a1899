"""Sweeps: many trials of many settings, resumable, on one machine or a cluster."""

from dqslam.sweep.file import Cell as Cell
from dqslam.sweep.file import Sweep as Sweep
from dqslam.sweep.file import load_sweep as load_sweep
from dqslam.sweep.run import SweepRun as SweepRun
from dqslam.sweep.run import run_sweep as run_sweep
from dqslam.sweep.settings import TrialSettings as TrialSettings
from dqslam.sweep.summary import CellSummary as CellSummary
from dqslam.sweep.summary import Share as Share
from dqslam.sweep.summary import Spread as Spread
from dqslam.sweep.summary import SweepSummary as SweepSummary
from dqslam.sweep.trial import METRICS as METRICS
from dqslam.sweep.trial import YES_OR_NO as YES_OR_NO
from dqslam.sweep.trial import TrialResult as TrialResult
