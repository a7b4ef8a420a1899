"""Results from files against the truth from files: all that ``dqslam evaluate`` reports."""

from dqslam.evaluation.boxes import box_overlaps as box_overlaps
from dqslam.evaluation.boxes import evaluate_association as evaluate_association
from dqslam.evaluation.boxes import evaluate_reprojection as evaluate_reprojection
from dqslam.evaluation.errors import PoseErrors as PoseErrors
from dqslam.evaluation.errors import pose_errors as pose_errors
from dqslam.evaluation.evaluation import evaluate_results as evaluate_results
from dqslam.evaluation.evaluation import object_alignment as object_alignment
from dqslam.evaluation.fits import BoxFits as BoxFits
from dqslam.evaluation.fits import fit_boxes as fit_boxes
from dqslam.evaluation.objects import evaluate_objects as evaluate_objects
from dqslam.evaluation.tracks import evaluate_tracks as evaluate_tracks
from dqslam.evaluation.trajectory import common_poses as common_poses
from dqslam.evaluation.trajectory import evaluate_trajectory as evaluate_trajectory
from dqslam.evaluation.trajectory import trajectory_error as trajectory_error
