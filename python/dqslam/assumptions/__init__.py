"""Prior assumptions: sizes of objects, and noise of boxes and odometry."""

from dqslam.assumptions.noise import BoxNoise as BoxNoise
from dqslam.assumptions.noise import OdometryNoise as OdometryNoise
from dqslam.assumptions.placements import GROUND as GROUND
from dqslam.assumptions.placements import PLANE as PLANE
from dqslam.assumptions.placements import PlacementRule as PlacementRule
from dqslam.assumptions.placements import PlacementRules as PlacementRules
from dqslam.assumptions.placements import check_placement_classes as check_placement_classes
from dqslam.assumptions.placements import load_placements as load_placements
from dqslam.assumptions.shapes import ClassShapes as ClassShapes
from dqslam.assumptions.shapes import load_shapes as load_shapes
from dqslam.assumptions.sizes import UNKNOWN_SIZE as UNKNOWN_SIZE
from dqslam.assumptions.sizes import SizePrior as SizePrior
from dqslam.assumptions.sizes import SizePriors as SizePriors
from dqslam.assumptions.sizes import load_size_priors as load_size_priors
