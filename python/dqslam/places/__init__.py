"""Places: maps of one place that are aligned, merged and compared."""

from dqslam.places.alignment import ALIGNMENT_FILE as ALIGNMENT_FILE
from dqslam.places.alignment import Alignment as Alignment
from dqslam.places.alignment import CannotTellError as CannotTellError
from dqslam.places.alignment import Rival as Rival
from dqslam.places.alignment import describe_alignment as describe_alignment
from dqslam.places.consensus import align as align
from dqslam.places.joining import MergedMap as MergedMap
from dqslam.places.joining import Part as Part
from dqslam.places.joining import merge as merge
from dqslam.places.joint import JointMap as JointMap
from dqslam.places.joint import merge_graphs as merge_graphs
from dqslam.places.joint import solve_together as solve_together
from dqslam.places.landmarks import Landmarks as Landmarks
from dqslam.places.landmarks import read_landmarks as read_landmarks
from dqslam.places.merged_files import MERGE_FILE as MERGE_FILE
from dqslam.places.together import Solved as Solved
from dqslam.places.together import solved_of as solved_of
