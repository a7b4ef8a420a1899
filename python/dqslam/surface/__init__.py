"""Surfaces of objects, and their relative positions, from depth images."""

from dqslam.surface.files import Mesh as Mesh
from dqslam.surface.files import read_meshes as read_meshes
from dqslam.surface.files import write_surfaces as write_surfaces
from dqslam.surface.fusion import fuse_surfaces as fuse_surfaces
from dqslam.surface.images import ColorImages as ColorImages
from dqslam.surface.images import DepthImages as DepthImages
from dqslam.surface.images import read_color_images as read_color_images
from dqslam.surface.images import read_depth_images as read_depth_images
from dqslam.surface.planes import Plane as Plane
from dqslam.surface.positions import relative_positions as relative_positions
from dqslam.surface.positions import write_positions as write_positions
from dqslam.surface.solid import Solid as Solid
from dqslam.surface.surfaces import Surface as Surface
from dqslam.surface.surfaces import SurfaceOptions as SurfaceOptions
from dqslam.surface.surfaces import Surfaces as Surfaces
