"""Ellipsoids, cuboids and cylinders as solids: what is drawn, projected and compared."""

from dqslam.solids.meshes import Mesh as Mesh
from dqslam.solids.meshes import mesh as mesh
from dqslam.solids.meshes import unit_sphere as unit_sphere
from dqslam.solids.meshes import wireframe as wireframe
from dqslam.solids.outlines import flat_outline as flat_outline
from dqslam.solids.outlines import project_to_outlines as project_to_outlines
from dqslam.solids.projection import box_chi_squares as box_chi_squares
from dqslam.solids.projection import project_to_boxes as project_to_boxes
from dqslam.solids.solids import MOMENTS as MOMENTS
from dqslam.solids.solids import Rows as Rows
from dqslam.solids.solids import Solids as Solids
from dqslam.solids.solids import body_solids as body_solids
from dqslam.solids.solids import hull_points as hull_points
