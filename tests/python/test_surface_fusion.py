"""Fused surfaces against the bodies whose depth was cast: distances, volumes, what was not seen."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dqslam as dq
from depth_scenes import (
    CAMERA,
    Cuboid,
    Ellipsoid,
    Floor,
    all_round,
    at,
    cast,
    in_world,
    look_at,
    results_of,
    ring,
)
from dqslam.recording.interpolation import interpolate_poses
from dqslam.surface.body import bodies_of

VOXEL = 0.012
COARSE = dq.SurfaceOptions(voxel=VOXEL)


def fused(poses, bodies, others=(), *, mapped=None, sigma=0.0, options=COARSE, colors=None):
    """Fuse what cameras at poses see of bodies and of other things."""
    images = cast(poses, [*bodies, *others], sigma=sigma)
    depth = dq.DepthImages.from_arrays(0.1 * np.arange(len(poses)), images)
    return dq.fuse_surfaces(results_of(poses, mapped or bodies), depth, colors, options)


def errors(body, surface):
    """Return signed distances of vertices from the true surface in voxels, outside positive."""
    return body.distance(in_world(surface)) / surface.voxel


@pytest.mark.parametrize("sigma", [0.0, 0.003])
@pytest.mark.parametrize("kind", [Ellipsoid, Cuboid])
def test_seen_from_all_sides(kind, sigma):
    body = at(0, 0, 0, half=(0.3, 0.2, 0.15), yaw=0.3, kind=kind)
    (found,) = fused(all_round(), [body], sigma=sigma).surfaces
    off = errors(body, found)
    assert np.median(np.abs(off)) < 0.3
    assert np.quantile(np.abs(off), 0.9) < 0.7
    assert abs(np.median(off)) < 0.1
    assert found.volume == pytest.approx(body.volume, rel=0.03)
    assert found.seen_share > 0.99
    np.testing.assert_allclose(found.extents, 2 * np.sort(body.half)[::-1], atol=2 * VOXEL)
    np.testing.assert_allclose(found.solid.center, 0.0, atol=0.2 * VOXEL)
    assert found.planes == ()


def test_a_sphere_is_watertight():
    import trimesh

    body = at(0, 0, 0, half=(0.2, 0.2, 0.2))
    (found,) = fused(all_round(), [body]).surfaces
    mesh = trimesh.Trimesh(found.vertices, found.faces)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.008, rel=0.02)
    assert found.solid.areas.sum() == pytest.approx(4 * np.pi * 0.04, rel=0.03)
    away = np.einsum("vi,vi->v", mesh.vertex_normals, found.vertices)
    assert (away > 0).mean() > 0.99  # normals point outward


def test_the_floor_is_not_of_what_stands_on_it():
    body = at(0, 0, 0.2, half=(0.2, 0.2, 0.2), yaw=0.3, kind=Cuboid)
    (found,) = fused(ring(16, 1.5, 0.9), [body], [Floor()], sigma=0.003).surfaces
    assert np.median(np.abs(errors(body, found))) < 0.3
    assert found.volume == pytest.approx(body.volume, rel=0.03)
    (plane,) = found.planes
    np.testing.assert_allclose(plane.normal, [0, 0, 1], atol=0.02)
    assert plane.offset == pytest.approx(-0.2, abs=0.3 * VOXEL)
    assert in_world(found)[:, 2].min() > -0.5 * VOXEL
    assert found.seen_share > 0.95


def test_a_body_that_is_wrong_does_not_shape_what_was_seen():
    body = at(0, 0, 0.2, half=(0.2, 0.2, 0.2), yaw=0.3, kind=Cuboid)
    wrong = at(0.03, -0.03, 0.14, half=(0.25, 0.2, 0.17), yaw=0.6, kind=Cuboid)
    (found,) = fused(ring(16, 1.5, 0.9), [body], [Floor()], mapped=[wrong]).surfaces
    assert np.median(np.abs(errors(body, found))) < 0.3
    assert found.volume == pytest.approx(body.volume, rel=0.03)


def test_neighbors_keep_their_own_surfaces():
    bodies = [
        at(0.0, 0.0, 0.2, half=(0.2, 0.2, 0.2), yaw=0.3, kind=Cuboid),
        at(0.45, 0.1, 0.15, half=(0.15, 0.15, 0.15), yaw=0.8, kind=Cuboid),
        at(-0.1, 0.42, 0.15, half=(0.2, 0.1, 0.15), yaw=0.8),
    ]
    found = fused(ring(16, 1.6, 1.0), bodies, [Floor()])
    assert [one.object_id for one in found.surfaces] == [0, 1, 2]
    for body, one in zip(bodies, found.surfaces, strict=True):
        assert np.median(np.abs(errors(body, one))) < 0.3
        assert one.volume == pytest.approx(body.volume, rel=0.05)


def test_what_no_image_saw_is_open_and_the_share_says_so():
    """One camera sees less than half of a sphere: at most the cap before its outline."""
    body = at(0, 0, 0, half=(0.2, 0.2, 0.2))
    poses = np.array([look_at(np.array([1.5, 0.0, 0.0]), np.zeros(3))])
    (found,) = fused(poses, [body]).surfaces
    assert 0.25 < found.seen_share < 0.5 * (1.0 - 0.2 / 1.5)
    assert found.vertices[:, 0].min() > -3 * VOXEL
    assert np.median(np.abs(errors(body, found))) < 0.3
    (closed,) = fused(poses, [body], options=replace(COARSE, closed=True)).surfaces
    assert closed.vertices[:, 0].min() < -0.15  # the rest is the map's
    assert closed.volume == pytest.approx(body.volume, rel=0.15)


def test_poses_are_interpolated_to_the_times_of_images():
    body = at(0, 0, 0, half=(0.2, 0.15, 0.15))
    path = ring(24, 1.5, 0.6)
    times = np.arange(len(path), dtype=float)
    between = times[:-1] + 0.4
    images = cast(interpolate_poses(times, path, between), [body])
    late = np.append(between, 99.0)
    depth = dq.DepthImages.from_arrays(late, [*images, images[0]])
    found = dq.fuse_surfaces(results_of(path, [body], times=times), depth, options=COARSE)
    assert (found.images, found.images_left_out) == (23, 1)
    assert np.median(np.abs(errors(body, found.surfaces[0]))) < 0.3


def test_objects_without_a_surface_are_named():
    bodies = [at(0, 0, 0, half=(0.2, 0.2, 0.2)), at(0, 0, 9.0, half=(0.2, 0.2, 0.2))]
    ghost = at(0, 0.9, 0, half=(0.1, 0.1, 0.1))
    results = results_of(ring(8, 1.5, 0.3), [*bodies, ghost, ghost])
    results.objects.semi_axes[3] = results.objects.orientations[3] = np.nan
    depth = dq.DepthImages.from_arrays(results.timestamps, cast(results.poses, bodies))
    found = dq.fuse_surfaces(results, depth, options=COARSE)
    assert [one.object_id for one in found.surfaces] == [0]
    assert found.left_out == {
        1: "no depth image looks at it",
        2: "depth shows no surface where it is",
        3: "it is no ellipsoid",
    }


@pytest.mark.parametrize(
    ("factor", "wanted"), [(5.0, "5000 would fit"), (0.2, "20[0-9.]+ would fit"), (1000.0, "e.06")]
)
def test_a_wrong_scale_is_named(factor, wanted):
    body, poses = at(0, 0, 0, half=(0.2, 0.2, 0.2)), ring(8, 1.5, 0.3)
    depth = dq.DepthImages.from_arrays(0.1 * np.arange(8), factor * cast(poses, [body]))
    with pytest.raises(ValueError, match=f"times the distances of the map.*{wanted}"):
        dq.fuse_surfaces(results_of(poses, [body]), depth, depth_scale=1000.0)


def test_what_is_refused():
    body, poses = at(0, 0, 0, half=(0.2, 0.2, 0.2)), ring(4, 1.5, 0.3)
    results, images = results_of(poses, [body]), cast(poses, [body])
    times = results.timestamps
    with pytest.raises(ValueError, match="no image is of the time of the path.*from 100"):
        dq.fuse_surfaces(results, dq.DepthImages.from_arrays(times + 100, images))
    with pytest.raises(ValueError, match="no image has any depth where the map has an object"):
        dq.fuse_surfaces(results, dq.DepthImages.from_arrays(times, 0 * images))
    with pytest.raises(ValueError, match=r"depth row 0: expected \(240, 320\), got \(240, 300\)"):
        dq.fuse_surfaces(results, dq.DepthImages.from_arrays(times, images[:, :, :300]))
    with pytest.raises(ValueError, match="are too many; take 0.0"):
        fine = dq.SurfaceOptions(voxel=1e-4)
        dq.fuse_surfaces(results, dq.DepthImages.from_arrays(times, images), options=fine)
    with pytest.raises(ValueError, match="has no object that is an ellipsoid"):
        nothing = results_of(poses, [])
        dq.fuse_surfaces(nothing, dq.DepthImages.from_arrays(times, images))
    with pytest.raises(ValueError, match="expected 4 images, one a time, got 3"):
        dq.DepthImages.from_arrays(times, images[:3])
    with pytest.raises(ValueError, match="times row 2: time does not increase"):
        dq.DepthImages.from_arrays([0.0, 1.0, 1.0, 2.0], images)
    for name, value in (("voxel", 0.0), ("margin", -1.0), ("depth_noise", np.inf)):
        with pytest.raises(ValueError, match=name.split("_")[0]):
            dq.SurfaceOptions(**{name: value})


def test_vertices_have_the_colors_of_the_side_that_images_show():
    """The half of a sphere with x > 0 is red, the other blue; nothing is green from outside."""
    body, poses = at(0, 0, 0, half=(0.2, 0.2, 0.2)), all_round()
    depth = cast(poses, [body])
    u, v = np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height))

    def read(row):
        turn = Rotation.from_quat(poses[row, 3:]).as_matrix()
        ray = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, 1 + 0 * u], -1)
        x = (ray * depth[row][..., None] @ turn.T + poses[row, :3])[..., 0]
        image = np.where((x > 0)[..., None], [255, 0, 0], [0, 0, 255])
        return np.where(depth[row][..., None] > 0, image, [0, 255, 0]).astype(np.uint8)

    times = 0.1 * np.arange(len(poses))
    colors = dq.surface.ColorImages(times, read)
    (found,) = fused(poses, [body], colors=colors).surfaces
    x = in_world(found)[:, 0]
    sure = np.abs(x) > 2 * VOXEL
    red, green, blue = found.colors[sure].T.astype(int)
    assert green.max() < 80
    assert (red > 150)[x[sure] > 0].mean() > 0.99
    assert (blue > 150)[x[sure] < 0].mean() > 0.99


@pytest.mark.parametrize("shape", [dq.Shape.CUBOID, dq.Shape.CYLINDER])
def test_voxels_reach_as_far_as_a_box_or_a_can(shape):
    """The ellipsoid that stands for it has the axes of the body in another order, and is larger."""
    half, turn = np.array([0.1, 0.1, 0.3]), Rotation.from_rotvec([0.2, -0.4, 0.9])
    shares = 5 / 3 if shape == dq.Shape.CUBOID else np.array([5 / 4, 5 / 4, 5 / 3])
    order = Rotation.from_matrix([[0, 1, 0], [0, 0, 1], [1, 0, 0]])  # z of the body becomes x
    semi_axes = (np.sqrt(shares) * half)[[2, 0, 1]]
    results = results_of(all_round()[:1], [at(0, 0, 0, half=half)])
    mapped = replace(
        results.objects,
        semi_axes=semi_axes[None],
        orientations=(turn * order).as_quat()[None],
        object_shapes=(shape,),
        half_lengths=half[None],
        rotation_vectors=turn.as_rotvec()[None],
    )
    np.testing.assert_allclose(bodies_of(mapped)[0].reach, [0.3, 0.1, 0.1], atol=1e-12)
