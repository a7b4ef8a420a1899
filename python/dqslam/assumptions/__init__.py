"""Prior assumptions: sizes of objects, and noise of boxes and odometry."""

from dqslam.assumptions.noise import BoxNoise as BoxNoise
from dqslam.assumptions.noise import OdometryNoise as OdometryNoise
from dqslam.assumptions.shapes import ClassShapes as ClassShapes
from dqslam.assumptions.shapes import load_shapes as load_shapes
from dqslam.assumptions.sizes import SizePrior as SizePrior
from dqslam.assumptions.sizes import SizePriors as SizePriors
from dqslam.assumptions.sizes import load_size_priors as load_size_priors
