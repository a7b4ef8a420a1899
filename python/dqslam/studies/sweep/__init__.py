"""Sweeps: many trials of many settings, resumable, on one machine or a cluster."""

from dqslam.studies.sweep.file import Cell as Cell
from dqslam.studies.sweep.file import Sweep as Sweep
from dqslam.studies.sweep.file import load_sweep as load_sweep
from dqslam.studies.sweep.run import SweepRun as SweepRun
from dqslam.studies.sweep.run import run_sweep as run_sweep
from dqslam.studies.sweep.settings import TrialSettings as TrialSettings
from dqslam.studies.sweep.summary import CellSummary as CellSummary
from dqslam.studies.sweep.summary import Share as Share
from dqslam.studies.sweep.summary import Spread as Spread
from dqslam.studies.sweep.summary import SweepSummary as SweepSummary
from dqslam.studies.sweep.trial import METRICS as METRICS
from dqslam.studies.sweep.trial import YES_OR_NO as YES_OR_NO
from dqslam.studies.sweep.trial import TrialResult as TrialResult
