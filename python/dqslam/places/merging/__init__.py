"""One map, and all paths in its frame, from maps of one place: solved together or fused."""

from dqslam.places.merging.files import MERGE_FILE as MERGE_FILE
from dqslam.places.merging.joining import MergedMap as MergedMap
from dqslam.places.merging.joining import Part as Part
from dqslam.places.merging.joining import merge as merge
from dqslam.places.merging.joint import JointMap as JointMap
from dqslam.places.merging.joint import merge_graphs as merge_graphs
from dqslam.places.merging.joint import solve_together as solve_together
from dqslam.places.merging.together import Solved as Solved
from dqslam.places.merging.together import solved_of as solved_of
