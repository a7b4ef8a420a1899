"""Pose graphs for other programs: poses, relative poses, objects as landmarks, and their files."""

from dqslam.io.pose_graph.boxes import positions_of_boxes as positions_of_boxes
from dqslam.io.pose_graph.g2o import write_g2o as write_g2o
from dqslam.io.pose_graph.graph import LandmarkEdges as LandmarkEdges
from dqslam.io.pose_graph.graph import PoseGraph as PoseGraph
from dqslam.io.pose_graph.results import pose_graph_of_results as pose_graph_of_results
