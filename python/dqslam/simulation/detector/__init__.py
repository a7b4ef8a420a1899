"""A simulated detector: the objects that get a box, how it is cut, and the id that it has."""

from dqslam.simulation.detector.border import cut_at_border as cut_at_border
from dqslam.simulation.detector.border import is_detected as is_detected
from dqslam.simulation.detector.border import is_in_image as is_in_image
from dqslam.simulation.detector.detect import Boxes as Boxes
from dqslam.simulation.detector.detect import Streams as Streams
from dqslam.simulation.detector.detect import detect as detect
from dqslam.simulation.detector.ids import associate as associate
from dqslam.simulation.detector.ids import switch_in_bursts as switch_in_bursts
from dqslam.simulation.detector.occlusion import Outline as Outline
from dqslam.simulation.detector.occlusion import hide as hide
from dqslam.simulation.detector.occlusion import seen_box as seen_box
