"""Real recordings: what is assumed of them, their estimate, and what can be said about it."""

from dqslam.pipeline.border import cut_edges as cut_edges
from dqslam.pipeline.border import with_cut_edges as with_cut_edges
from dqslam.pipeline.conclude import Outcome as Outcome
from dqslam.pipeline.conclude import RunResult as RunResult
from dqslam.pipeline.conclude import conclude as conclude
from dqslam.pipeline.hold_out import choose_held_out as choose_held_out
from dqslam.pipeline.pipeline import perturb_odometry as perturb_odometry
from dqslam.pipeline.pipeline import run as run
from dqslam.pipeline.report import box_chi2 as box_chi2
from dqslam.pipeline.report import trajectory_error as trajectory_error
