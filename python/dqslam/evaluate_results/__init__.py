"""Results from files against the truth from files: all that ``dqslam evaluate`` reports."""

from dqslam.evaluate_results.boxes import box_overlaps as box_overlaps
from dqslam.evaluate_results.boxes import judge_association as judge_association
from dqslam.evaluate_results.boxes import judge_reprojection as judge_reprojection
from dqslam.evaluate_results.errors import PoseErrors as PoseErrors
from dqslam.evaluate_results.errors import pose_errors as pose_errors
from dqslam.evaluate_results.evaluation import evaluate_results as evaluate_results
from dqslam.evaluate_results.evaluation import object_alignment as object_alignment
from dqslam.evaluate_results.fits import BoxFits as BoxFits
from dqslam.evaluate_results.fits import fit_boxes as fit_boxes
from dqslam.evaluate_results.objects import judge_objects as judge_objects
from dqslam.evaluate_results.trajectory import common_poses as common_poses
from dqslam.evaluate_results.trajectory import judge_trajectory as judge_trajectory
