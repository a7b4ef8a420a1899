"""Places: maps of one place that are aligned, merged and compared, and cameras found in them."""

from dqslam.places.alignment import ALIGNMENT_FILE as ALIGNMENT_FILE
from dqslam.places.alignment import Alignment as Alignment
from dqslam.places.alignment import CannotTellError as CannotTellError
from dqslam.places.alignment import Rival as Rival
from dqslam.places.alignment import align as align
from dqslam.places.alignment import describe_alignment as describe_alignment
from dqslam.places.landmarks import Landmarks as Landmarks
from dqslam.places.landmarks import read_landmarks as read_landmarks
from dqslam.places.merging import MERGE_FILE as MERGE_FILE
from dqslam.places.merging import JointMap as JointMap
from dqslam.places.merging import MergedMap as MergedMap
from dqslam.places.merging import Part as Part
from dqslam.places.merging import Solved as Solved
from dqslam.places.merging import merge as merge
from dqslam.places.merging import merge_graphs as merge_graphs
from dqslam.places.merging import solve_together as solve_together
from dqslam.places.merging import solved_of as solved_of
