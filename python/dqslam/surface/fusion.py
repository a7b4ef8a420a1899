"""Fusion of the surfaces of a map's objects from depth images along the estimated path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dqslam.io import Results, nearest_pose
from dqslam.surface.body import Body, bodies_of
from dqslam.surface.color import Painter, vertex_normals
from dqslam.surface.images import ColorImages, DepthImages
from dqslam.surface.planes import background_planes, surface_points
from dqslam.surface.scale import check_scale, depth_ratio
from dqslam.surface.solid import solid_of
from dqslam.surface.surfaces import Surface, SurfaceOptions, Surfaces
from dqslam.surface.views import View, Views, poses_at
from dqslam.surface.volume import Volume

# Objects are fused together as long as they have no more voxels than this, of twenty bytes each;
# then all images are read again for the next ones.
VOXELS_AT_ONCE = 20_000_000
MOST_VOXELS = 50_000_000  #: of one object
_VOXELS_ALONG = 128
_TRUNCATION_VOXELS, _TRUNCATION_SIGMAS = 4.0, 4.0
_FUSING = 0.6  # the share of the work, if there are colors, too
_SCALE_IMAGES = 40  # that are compared with the map before any is fused

Progress = Callable[[float], None]


def fuse_surfaces(
    results: Results,
    depth: DepthImages,
    colors: ColorImages | None = None,
    options: SurfaceOptions | None = None,
    *,
    depth_scale: float | None = None,
    progress: Progress = lambda share: None,
) -> Surfaces:
    """Fuse the surface of each object of a map from depth images, in the frame of the object.

    Each object has a truncated signed distance function on voxels around its ellipsoid. What is
    nearer to another object, and planes on which the object stands or before which it hangs, are
    not of it.

    Parameters
    ----------
    results
        Map and path, from ``load_results``.
    depth, colors
        Images of the camera of the results, from ``surface.read_depth_images`` and
        ``surface.read_color_images``, or ``surface.DepthImages.from_arrays``.
    depth_scale
        The scale with which depth was read, for the error about a wrong one.
    progress
        Is called with the share of the work that is done, 0 to 1.

    Raises
    ------
    FileError
        If an image cannot be read, or is not of the camera's size.
    ValueError
        If no image is of the time of the path, depth contradicts the distances of the map, no
        object is an ellipsoid, or an object would have too many voxels.
    """
    how = options or SurfaceOptions()
    views = Views.along(results.camera, results.timestamps, results.poses, depth)
    bodies = bodies_of(results.objects)
    if not bodies:
        raise ValueError(f"{results.directory}: the map has no object that is an ellipsoid")
    _check_scale(views, bodies, depth_scale)
    ids = results.objects.object_ids.tolist()
    left_out = {number: "it is no ellipsoid" for row, number in enumerate(ids) if row not in bodies}
    volumes: dict[int, Volume] = {}
    for row, body in bodies.items():
        volume = _volume(f"object {ids[row]}", body, views, how)
        if volume is None:
            left_out[ids[row]] = "no depth image looks at it"
        else:
            volumes[row] = volume
    found: list[Surface] = []
    batches = _batches(volumes)
    fusing = 1.0 if colors is None else _FUSING
    for number, batch in enumerate(batches):
        first, last = number / len(batches), (number + fusing) / len(batches)
        _fuse(batch, views, _between(progress, first, last))
        made = {}
        for row, volume in batch.items():
            surface = _surface(results, row, volume, bodies, how)
            if surface is None:
                left_out[ids[row]] = "depth shows no surface where it is"
            else:
                made[row] = surface
        if colors is not None:
            rest = _between(progress, last, (number + 1) / len(batches))
            _paint(made, results, views, colors, rest)
        found += made.values()
    return Surfaces(tuple(found), left_out, len(views), len(depth) - len(views))


def _between(progress: Progress, first: float, last: float) -> Progress:
    """Return the progress of a part of the work, from one share of all to another."""
    return lambda share: progress(first + share * (last - first))


def _check_scale(views: Views, bodies: dict[int, Body], scale: float | None) -> None:
    places = np.unique(np.linspace(0, len(views) - 1, _SCALE_IMAGES).astype(int))
    ratios = [
        depth_ratio(views.view(int(place)), body)
        for place in places
        for body in bodies.values()
        if views.see(int(place), body.center, 0.0)
    ]
    check_scale(views.images.name, scale, np.array(ratios))


def _volume(name: str, body: Body, views: Views, how: SurfaceOptions) -> Volume | None:
    """Return the empty volume of an object; None if no image looks at it."""
    distances = [
        float(np.linalg.norm(views.poses[place, :3] - body.center))
        for place in range(len(views))
        if views.see(place, body.center, 0.0)
    ]
    if not distances:
        return None
    distance = float(np.median(distances))
    sigma = how.depth_noise * distance**2
    reach = (1.0 + how.margin) * body.reach
    pixel = distance / min(views.camera.fx, views.camera.fy)
    voxel = how.voxel or max(2.0 * float(reach.max()) / _VOXELS_ALONG, sigma, pixel)
    truncation = max(_TRUNCATION_VOXELS * voxel, _TRUNCATION_SIGMAS * sigma)
    count = float(np.prod(2.0 * (reach + truncation) / voxel + 1.0))
    if count > MOST_VOXELS:
        least = voxel * np.cbrt(count / MOST_VOXELS)
        raise ValueError(
            f"{name}: {count:.3g} voxels of {voxel:g} m are too many; take {least:.2g} m or more"
        )
    return Volume(body, voxel, truncation, reach + truncation, how.depth_noise)


def _batches(volumes: dict[int, Volume]) -> list[dict[int, Volume]]:
    """Split the objects into parts whose voxels are held together."""
    batches: list[dict[int, Volume]] = []
    size = VOXELS_AT_ONCE
    for row, volume in volumes.items():
        count = int(np.prod(volume.shape))
        if size + count > VOXELS_AT_ONCE:
            batches.append({})
            size = 0
        batches[-1][row] = volume
        size += count
    return batches


def _fuse(volumes: dict[int, Volume], views: Views, progress: Progress) -> None:
    for volume in volumes.values():
        volume.make()
    for place in range(len(views)):
        seen = [
            volume
            for volume in volumes.values()
            if views.see(place, volume.body.center, float(np.linalg.norm(volume.half_lengths)))
        ]
        if seen:
            view = views.view(place)
            for volume in seen:
                volume.integrate(view)
        progress((place + 1) / len(views))


def _surface(
    results: Results, row: int, volume: Volume, bodies: dict[int, Body], how: SurfaceOptions
) -> Surface | None:
    """Return the surface of an object, without colors; None if nothing of it was seen."""
    points, normals = surface_points(volume)
    planes = background_planes(points, normals, volume.body, volume.voxel)
    reach = float(np.linalg.norm(volume.half_lengths))
    others = [
        body
        for other, body in bodies.items()
        if other != row
        and np.linalg.norm(body.center - volume.body.center) < reach + body.semi_axes.max()
    ]
    solid = solid_of(volume, planes, others)
    volume.forget()
    if solid is None or not solid.seen.any():
        return None
    vertices, faces = solid.part(np.ones_like(solid.seen) if how.closed else solid.seen)
    return Surface(
        object_id=int(results.objects.object_ids[row]),
        class_name=results.objects.class_names[row],
        vertices=vertices,
        faces=faces,
        colors=None,
        solid=solid,
        planes=tuple(planes),
        voxel=volume.voxel,
        truncation=volume.truncation,
        images=volume.images,
        center=results.objects.centers[row],
        orientation_xyzw=results.objects.orientations[row],
    )


def _paint(
    surfaces: dict[int, Surface],
    results: Results,
    views: Views,
    colors: ColorImages,
    progress: Progress,
) -> None:
    """Give surfaces the colors of images, each with the depth image that is nearest in time."""
    bodies = bodies_of(results.objects)
    painters = {}
    for row, one in surfaces.items():
        normals = vertex_normals(one.vertices, one.faces) @ bodies[row].world_from_object.T
        painters[row] = Painter(bodies[row].to_world(one.vertices), normals, one.truncation)
    for place, image in enumerate(_images_of(views, colors)):
        near = [
            row
            for row in painters
            if image >= 0 and views.see(place, bodies[row].center, bodies[row].semi_axes.max())
        ]
        if near:
            view, pixels = views.view(place), colors.read(image)
            pose = poses_at(results.timestamps, results.poses, colors.times[[image]])[0]
            for row in near:
                painters[row].paint(view, _at(view, pose), pixels)
        progress((place + 1) / len(views))
    for row, painter in painters.items():
        surfaces[row] = replace(surfaces[row], colors=painter.colors())


def _images_of(views: Views, colors: ColorImages) -> list[int]:
    """Return the color image of each depth image: the nearest within half their interval, or -1."""
    if len(colors.times) == 1:
        return [0 if abs(time - colors.times[0]) == 0.0 else -1 for time in views.times.tolist()]
    rows, off = nearest_pose(colors.times, views.times)
    usual = float(np.median(np.diff(colors.times)))
    found = np.where(off <= 0.5 * usual, rows, -1).tolist()
    if max(found) < 0:
        raise ValueError("color images: none is within half an interval of a depth image")
    return [int(row) for row in found]


def _at(view: View, pose: np.ndarray) -> View:
    """Return a view without its depth, from another pose."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(pose[3:]).as_matrix()
    return View(view.camera, view.depth, pose[:3], turn)
