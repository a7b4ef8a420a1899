"""Real recordings: what is assumed of them, their estimate, and what can be said about it."""

from dqslam.run_recording.border import cut_edges as cut_edges
from dqslam.run_recording.border import with_cut_edges as with_cut_edges
from dqslam.run_recording.conclude import Outcome as Outcome
from dqslam.run_recording.conclude import RunResult as RunResult
from dqslam.run_recording.conclude import conclude as conclude
from dqslam.run_recording.hold_out import choose_held_out as choose_held_out
from dqslam.run_recording.pipeline import perturb_odometry as perturb_odometry
from dqslam.run_recording.pipeline import run as run
from dqslam.run_recording.report import box_chi2 as box_chi2
from dqslam.run_recording.report import trajectory_error as trajectory_error
