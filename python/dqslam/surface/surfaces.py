"""The surfaces of a map's objects, as plain data, and how they are to be fused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._repr import counted
from dqslam.surface.images import Colors
from dqslam.surface.planes import Plane
from dqslam.surface.solid import Solid


@dataclass(frozen=True, kw_only=True)
class SurfaceOptions:
    """How surfaces are fused."""

    voxel: float | None = None
    """Side of a voxel, meters; by default from the size of the object and the noise of depth."""
    margin: float = 0.5
    """How much further than the ellipsoid the voxels reach, as a share of its semi-axes."""
    depth_noise: float = 0.002
    """Sigma of depth at one meter, meters; it grows with the square of the distance."""
    closed: bool = False
    """Whether meshes are closed where no image has seen the object."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.voxel is not None and not (np.isfinite(self.voxel) and self.voxel > 0.0):
            raise ValueError(f"voxel is {self.voxel:g} m, not positive")
        if not 0.0 <= self.margin <= 5.0:
            raise ValueError(f"margin is {self.margin:g}, not from 0 to 5")
        if not (np.isfinite(self.depth_noise) and self.depth_noise > 0.0):
            raise ValueError(f"depth noise is {self.depth_noise:g} m, not positive")


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface of an object in its own frame: its center, and the axes of its ellipsoid."""

    object_id: int
    class_name: str
    vertices: Floats
    """Meters, shape (v, 3)."""
    faces: Ints
    """Rows of vertices, counter-clockwise from outside, shape (f, 3)."""
    colors: Colors | None
    """Red, green and blue of each vertex, 0 to 255, (v, 3); None without color images."""
    solid: Solid
    """The closed solid, of which the faces are those that were seen, or all."""
    planes: tuple[Plane, ...]
    """Planes behind or below the object that were cut off, in its frame."""
    voxel: float
    """Side of a voxel, meters."""
    truncation: float
    """Distance from the surface up to which voxels know it, meters."""
    images: int
    """Number of depth images that were fused."""
    center: Floats
    """Center of the object in the world when the surface was fused, meters, shape (3,)."""
    orientation_xyzw: Floats
    """world_from_object at that time, shape (4,)."""

    def __repr__(self) -> str:
        """Show what it is of, and its size."""
        name = f"{self.class_name} {self.object_id}"
        return f"Surface({name}, {len(self.faces)} faces, {100 * self.seen_share:.0f}% seen)"

    @property
    def world_from_object(self) -> Floats:
        """Rotation matrix (3, 3) of the frame in the world when the surface was fused."""
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_quat(self.orientation_xyzw).as_matrix())

    def to_world(self, points_in_object: Floats) -> Floats:
        """Return points (p, 3) or (3,) in the world as it was when the surface was fused."""
        return np.asarray(points_in_object @ self.world_from_object.T + self.center)

    def to_object(self, points_in_world: Floats) -> Floats:
        """Return points (p, 3) or (3,) of that world in the frame of the object."""
        return np.asarray((points_in_world - self.center) @ self.world_from_object)

    @property
    def volume(self) -> float:
        """Of the closed solid, cubic meters."""
        return self.solid.volume

    @property
    def seen_share(self) -> float:
        """The share of the solid's surface, apart from where it stands, that images saw."""
        return self.solid.seen_share

    @property
    def extents(self) -> Floats:
        """Sides of the smallest box around the solid, meters, descending, shape (3,)."""
        from trimesh.bounds import oriented_bounds

        _, sides = oriented_bounds(self.solid.vertices)
        return np.sort(np.asarray(sides, dtype=float))[::-1]


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The surfaces of the objects of a map."""

    surfaces: tuple[Surface, ...]
    """In the order of the map's objects."""
    left_out: Mapping[int, str]
    """Reasons why objects have none, by their ids."""
    images: int
    """Number of depth images whose pose is known."""
    images_left_out: int
    """Number of depth images at times at which it is not."""

    def __len__(self) -> int:
        """Return the number of surfaces."""
        return len(self.surfaces)

    def __repr__(self) -> str:
        """Show how many there are, and from how many images."""
        return f"Surfaces({counted(len(self), 'surface')} from {counted(self.images, 'image')})"
