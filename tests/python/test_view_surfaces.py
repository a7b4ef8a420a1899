"""Surfaces of objects in viewers: coarser meshes, the page in a browser, viser and Foxglove."""

import shutil

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from browser import on_screen, open_page, start_browser, web_server
from depth_scenes import Cuboid, at, cast, results_of, ring, write_files
from dqslam.cli import main
from dqslam.io import FileError, load_results
from dqslam.view import build_scene, serve, write_mcap
from dqslam.view.surface_mesh import SurfaceMesh
from dqslam.view.surfaces import coarser, with_surfaces
from test_view_foxglove import quaternion, read, vector

pytest.importorskip("skimage", reason="the extra surface is not installed")
trimesh = pytest.importorskip("trimesh", reason="the extra surface is not installed")

BODIES = (
    at(0.0, 0.0, 0.2, half=(0.25, 0.2, 0.15), yaw=0.4, kind=Cuboid),
    at(0.1, 0.9, 0.2, half=(0.2, 0.1, 0.1)),
)


@pytest.fixture(scope="module")
def fused(tmp_path_factory):
    """Give a directory of results with the surface of a cuboid, red, and of an ellipsoid."""
    folder = tmp_path_factory.mktemp("surfaces") / "out"
    poses = ring(12, 1.8, 0.9, target=(0.0, 0.3, 0.2))
    depth = write_files(folder, results_of(poses, BODIES), cast(poses, BODIES))
    assert main(["shape", str(folder), "--depth", str(depth), "--depth-scale", "5000", "-q"]) == 0
    path = folder / "surfaces" / "object_0.ply"
    mesh = trimesh.load(path, process=False)
    mesh.visual.vertex_colors = np.tile([200, 30, 20, 255], (len(mesh.vertices), 1))
    mesh.export(path)
    return folder


@pytest.fixture(scope="module")
def scene(fused):
    return with_surfaces(build_scene(load_results(fused)), fused)


def sphere(subdivisions=4, radius=0.5):
    mesh = trimesh.creation.icosphere(subdivisions, radius)
    colors = np.where(mesh.vertices[:, 2:] > 0, [200, 0, 0], [0, 0, 100]).astype(np.uint8)
    return SurfaceMesh(mesh.vertices, mesh.faces, colors)


@pytest.mark.parametrize("most", [100, 700, 3000])
def test_coarser_meshes_keep_shape_and_colors(most):
    fine = sphere()
    assert len(fine.triangles) == 5120
    found = coarser(fine, most)
    assert most / 3 < len(found.triangles) <= most
    radii = np.linalg.norm(found.vertices, axis=1)
    cell = 2 * 0.5 / np.sqrt(most / 12)  # 12 n^2 triangles at most, of n cells along 1 m
    assert (radii > 0.5 - cell).all() and (radii < 0.5 + 1e-9).all()
    mesh = trimesh.Trimesh(found.vertices, found.triangles, process=False)
    assert mesh.volume == pytest.approx(np.pi / 6, rel=0.25 if most == 100 else 0.08)
    upper = found.vertices[:, 2] > cell
    np.testing.assert_array_equal(found.colors[upper], np.tile([200, 0, 0], (upper.sum(), 1)))


def test_meshes_that_are_small_enough_stay():
    fine = sphere(1)
    assert coarser(fine, 80) is fine
    assert len(coarser(fine, 3).triangles) <= 3


def test_surfaces_are_in_the_frame_of_their_objects(scene):
    for one, body in zip(scene.objects, BODIES, strict=True):
        turn = Rotation.from_quat(one.orientation_xyzw)
        points = turn.apply(one.surface.vertices) + one.center
        assert np.median(np.abs(body.distance(points))) < 0.004
    np.testing.assert_array_equal(
        np.unique(scene.objects[0].surface.colors, axis=0), [[200, 30, 20]]
    )
    # A mesh without colors has that of its object.
    red, green, blue = scene.objects[1].surface.colors[0]
    assert f"#{red:02x}{green:02x}{blue:02x}" == scene.objects[1].color.lower()


def test_the_page_draws_surfaces(fused, tmp_path):
    assert main(["view", str(fused), "--export", str(tmp_path / "page"), "-q"]) == 0
    red = """() => {
      const canvas = document.getElementById("space"), { width } = canvas;
      const { data } = canvas.getContext("2d").getImageData(0, 0, width, canvas.height);
      const found = [];
      for (let k = 0; k < data.length / 4; k += 1) {
        const [r, g, b] = data.slice(4 * k, 4 * k + 3);
        if (r > 60 && g < 0.3 * r && b < 0.3 * r) found.push([k % width, Math.floor(k / width)]);
      }
      return found;
    }"""
    with (
        start_browser() as browser,
        web_server(tmp_path / "page") as address,
        open_page(browser, address) as page,
    ):
        page.wait_for_function("window.onScreen")
        for name in ("cameras", "names", "estimate", "odometry"):
            page.uncheck(f"#show-{name}")
        shown = on_screen(page)
        assert shown["ellipsoids"] == 0
        triangles = page.evaluate("scene.objects.map((one) => one.surface.triangles.length)")
        assert all(500 < count <= 2000 for count in triangles)
        assert shown["triangles"] == sum(triangles)
        # The cuboid looks the same from both ends of each axis, so its middle is where it is.
        pixels = np.array(page.evaluate(red))
        (place,) = [one for one in shown["places"] if one["id"] == 0]
        assert len(pixels) > 2000
        middle = 0.5 * (pixels.min(axis=0) + pixels.max(axis=0))
        size = np.ptp(pixels, axis=0).min()
        np.testing.assert_allclose(middle, [place["u"], place["v"]], atol=0.15 * size)
        page.uncheck("#show-surfaces")
        shown = on_screen(page)
        assert (shown["ellipsoids"], shown["triangles"]) == (2, 0)
        assert len(page.evaluate(red)) < 100


def test_foxglove_has_triangles(scene, tmp_path):
    pytest.importorskip("foxglove", reason="the extra mcap is not installed")
    write_mcap(scene, tmp_path / "map.mcap")
    messages, _ = read(tmp_path / "map.mcap")
    ((_, update),) = messages["/map"]
    for entity, one, body in zip(update.entities, scene.objects, BODIES, strict=True):
        assert not (entity.spheres or entity.cubes or entity.cylinders)
        (mesh,) = entity.triangles
        assert len(mesh.colors) == len(mesh.points)
        assert len(mesh.indices) % 3 == 0 and 1000 < len(mesh.indices) <= 3 * 5000
        assert max(mesh.indices) < len(mesh.points)
        turn = Rotation.from_quat(quaternion(mesh.pose.orientation))
        points = turn.apply([vector(point) for point in mesh.points]) + vector(mesh.pose.position)
        assert np.median(np.abs(body.distance(points))) < 0.006
        np.testing.assert_allclose(vector(mesh.pose.position), one.center)


def test_the_live_page_shows_them(scene, monkeypatch):
    viser = pytest.importorskip("viser", reason="the extra view is not installed")
    add, added = viser.SceneApi.add_mesh_trimesh, []

    def recorded(self, name, mesh, **pose):
        added.append((name, mesh, pose))
        return add(self, name, mesh, **pose)

    monkeypatch.setattr(viser.SceneApi, "add_mesh_trimesh", recorded)
    with serve(scene):
        pass
    assert [name for name, _, _ in added] == ["/objects/0", "/objects/1"]
    for (_, mesh, pose), one in zip(added, scene.objects, strict=True):
        np.testing.assert_array_equal(mesh.vertices, one.surface.vertices)
        np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], one.surface.colors)
        np.testing.assert_allclose(pose["position"], one.center)
        np.testing.assert_allclose(np.roll(pose["wxyz"], -1), one.orientation_xyzw)


def test_meshes_of_another_map_are_refused(fused, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(fused, copy)
    table = copy / "surfaces" / "surfaces.json"
    table.write_text(table.read_text().replace('"id": 1,', '"id": 7,'))
    scene = build_scene(load_results(copy))
    with pytest.raises(FileError, match=r"surfaces\.json: object 7 is not an ellipsoid of the map"):
        with_surfaces(scene, copy)


def test_without_trimesh_the_extra_is_named(fused, monkeypatch):
    monkeypatch.setattr("dqslam.view.surfaces.find_spec", lambda name: None)
    with pytest.raises(RuntimeError, match=r"pip install 'dqslam\[surface\]'"):
        with_surfaces(build_scene(load_results(fused)), fused)
