"""How two maps of one place lie to each other, and whether they say so."""

from dqslam.places.alignment.consensus import MotionName as MotionName
from dqslam.places.alignment.consensus import align as align
from dqslam.places.alignment.result import ALIGNMENT_FILE as ALIGNMENT_FILE
from dqslam.places.alignment.result import Alignment as Alignment
from dqslam.places.alignment.result import CannotTellError as CannotTellError
from dqslam.places.alignment.result import Rival as Rival
from dqslam.places.alignment.result import describe_alignment as describe_alignment
