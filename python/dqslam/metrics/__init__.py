"""Errors of an estimate against the truth, as numbers with units; nothing here plots or prints."""

from dqslam.metrics.alignment import Align as Align
from dqslam.metrics.alignment import Alignment as Alignment
from dqslam.metrics.alignment import align_poses as align_poses
from dqslam.metrics.alignment import align_positions as align_positions
from dqslam.metrics.alignment import align_rigid as align_rigid
from dqslam.metrics.association import AssociationScore as AssociationScore
from dqslam.metrics.association import score_association as score_association
from dqslam.metrics.iou import box_iou as box_iou
from dqslam.metrics.iou import ellipsoid_iou as ellipsoid_iou
from dqslam.metrics.iou import match_boxes as match_boxes
from dqslam.metrics.iou import reprojection_iou as reprojection_iou
from dqslam.metrics.iou import solid_iou as solid_iou
from dqslam.metrics.objects import Matches as Matches
from dqslam.metrics.objects import center_errors as center_errors
from dqslam.metrics.objects import match_by_id as match_by_id
from dqslam.metrics.objects import match_nearest as match_nearest
from dqslam.metrics.objects import orientation_error as orientation_error
from dqslam.metrics.objects import size_error as size_error
from dqslam.metrics.outline import projected_edges as projected_edges
from dqslam.metrics.outline import through_lens as through_lens
from dqslam.metrics.outline import visible_outlines as visible_outlines
from dqslam.metrics.simulation import Report as Report
from dqslam.metrics.simulation import box_volumes as box_volumes
from dqslam.metrics.simulation import cube_volumes as cube_volumes
from dqslam.metrics.simulation import ellipsoid_volumes as ellipsoid_volumes
from dqslam.metrics.simulation import evaluate as evaluate
from dqslam.metrics.simulation import mean_distance as mean_distance
from dqslam.metrics.simulation import position_error as position_error
from dqslam.metrics.simulation import true_rows as true_rows
from dqslam.metrics.trajectory import RelativePoseError as RelativePoseError
from dqslam.metrics.trajectory import Statistics as Statistics
from dqslam.metrics.trajectory import TrajectoryError as TrajectoryError
from dqslam.metrics.trajectory import (
    absolute_trajectory_error as absolute_trajectory_error,
)
from dqslam.metrics.trajectory import relative_pose_error as relative_pose_error
from dqslam.metrics.trajectory import statistics as statistics
from dqslam.metrics.upright import up_direction as up_direction
