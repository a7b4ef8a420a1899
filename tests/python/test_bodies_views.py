"""Cuboids and cylinders as they are drawn: figures, overlays, page, live page, Foxglove."""

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import planted_bodies as planted
from browser import on_screen, open_page, start_browser, web_server
from dqslam.evaluation import fit_boxes
from dqslam.io import load_results
from dqslam.metrics import visible_outlines
from dqslam.plot.above import from_above
from dqslam.plot.boxes import draw_worst_and_median
from dqslam.plot.overlay import Overlay
from dqslam.plot.results_map import draw_results_map
from dqslam.view import build_scene, serve, write_mcap, write_page
from test_view_foxglove import quaternion, read, vector

SIZE = (planted.CAMERA.width, planted.CAMERA.height)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bodies") / "out"
    planted.write_bodies(folder)
    return load_results(folder)


def is_straight(line):
    along, others = line[-1] - line[0], line - line[0]
    return np.max(np.abs(along[0] * others[:, 1] - along[1] * others[:, 0])) < 1e-6


def drawn(figure, what):
    (axes,) = figure.axes
    return [one.get_xydata() for one in axes.lines if one.get_gid() == what]


def test_outlines_in_the_image_are_the_hulls_of_surfaces(results):
    pose = results.poses[4]
    rows, outlines = visible_outlines(results.camera, pose, results.objects.solids)
    assert sorted(rows.tolist()) == [0, 1, 2]
    for row, outline in zip(rows.tolist(), outlines, strict=True):
        surface = planted.pixels(row, pose)
        np.testing.assert_allclose(outline.min(axis=0), surface.min(axis=0), atol=0.1)
        np.testing.assert_allclose(outline.max(axis=0), surface.max(axis=0), atol=0.1)
        area = ConvexHull(surface).volume
        assert ConvexHull(outline).volume == pytest.approx(area, rel=3e-3)


def test_overlays_have_the_edges_of_bodies(results, tmp_path):
    image = tmp_path / "0004.png"
    Image.new("RGB", SIZE, (128, 128, 128)).save(image)
    figure = Overlay(results).draw(4, image)
    assert len(drawn(figure, "outline")) == 3
    edges = drawn(figure, "edge")
    assert len(edges) == 12 + 6  # of the cuboid and of the cylinder
    pose, scale = results.poses[4], [planted.CAMERA.fx, planted.CAMERA.fy]
    corners = planted.TURNS[0].apply(
        [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)] * planted.HALF_LENGTHS
    )
    points = Rotation.from_quat(pose[3:]).inv().apply(corners + planted.CENTERS[0] - pose[:3])
    pixels = points[:, :2] / points[:, 2:] * scale + [planted.CAMERA.cx, planted.CAMERA.cy]
    straight = [edge for edge in edges if is_straight(edge)]
    ends = np.array([end for edge in straight for end in (edge[0], edge[-1])])
    for pixel in pixels:
        assert np.sum(np.linalg.norm(ends - pixel, axis=1) < 1e-6) == 3  # edges at a corner


def test_the_figure_of_boxes_has_bodies(results):
    figure = draw_worst_and_median(results, fit_boxes(results))
    for axes in figure.axes:
        gids = [one.get_gid() for one in axes.lines]
        assert (gids.count("outline"), gids.count("edge")) == (3, 18)


def test_the_map_from_above_has_their_shadows(results):
    figure = draw_results_map(results)
    view = from_above(results.poses)
    for row, outline in enumerate(drawn(figure, "object")):
        flat = view.points(planted.surface(row))
        np.testing.assert_allclose(outline.min(axis=0), flat.min(axis=0), atol=3e-4)
        np.testing.assert_allclose(outline.max(axis=0), flat.max(axis=0), atol=3e-4)
        assert ConvexHull(outline).volume == pytest.approx(ConvexHull(flat).volume, rel=5e-3)


def test_numbers_name_the_shape_and_its_lengths(results):
    scene = build_scene(results)
    numbers = [dict(one.numbers) for one in scene.objects]
    assert [one.get("shape") for one in numbers] == ["cuboid", "cylinder", None]
    assert numbers[0]["size"] == "0.160 × 0.100 × 0.060 m"
    assert numbers[0]["σ of size"] == "10 % × 20 % × 30 %"
    assert scene.objects[2].body is None


def test_foxglove_has_cubes_and_cylinders(results, tmp_path):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed: the extra mcap")
    write_mcap(build_scene(results), tmp_path / "map.mcap")
    messages, _ = read(tmp_path / "map.mcap")
    ((_, update),) = messages["/map"]
    counts = [(len(one.cubes), len(one.cylinders), len(one.spheres)) for one in update.entities]
    assert counts == [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    primitives = [update.entities[0].cubes[0], update.entities[1].cylinders[0]]
    for row, one in enumerate(primitives):
        np.testing.assert_allclose(vector(one.size), 2 * planted.HALF_LENGTHS)
        np.testing.assert_allclose(vector(one.pose.position), planted.CENTERS[row])
        turn = np.array(quaternion(one.pose.orientation))
        assert abs(turn @ planted.TURNS[row].as_quat()) == pytest.approx(1.0)
    cylinder = primitives[1]
    assert (cylinder.bottom_scale, cylinder.top_scale) == (1.0, 1.0)


def test_pages_draw_bodies(results, tmp_path):
    pytest.importorskip("viser", reason="viser is not installed")
    scene = build_scene(results)
    write_page(scene, tmp_path / "page")
    with start_browser() as browser:
        with web_server(tmp_path / "page") as address, open_page(browser, address) as page:
            page.wait_for_function("window.onScreen")
            shown = on_screen(page)
            assert (shown["ellipsoids"], shown["image"]["outlines"]) == (3, 3)
            # The hull on the image plane, and what is inside of it, as Python has them.
            pose = results.poses[-1]
            for row in range(2):
                polygon = page.evaluate(
                    """(row) => {
                      const one = scene.objects[row], view = geometry.viewOf(scene.estimate.at(-1));
                      const shape = geometry.shapeOf(one.semiAxes, one.orientation);
                      return geometry.outlineOfObject(view, scene.camera, one, shape).polygon;
                    }""",
                    row,
                )
                surface = planted.pixels(row, pose)
                area = ConvexHull(surface).volume
                assert ConvexHull(polygon).volume == pytest.approx(area, rel=5e-3)
                u, v = surface.mean(axis=0)
                inside = "([polygon, u, v]) => geometry.contains({ polygon }, u, v)"
                assert page.evaluate(inside, [polygon, u, v])
                u = surface[:, 0].max() + 1.0
                assert not page.evaluate(inside, [polygon, u, v])
        with serve(scene, port=18090) as address, open_page(browser, address) as page:
            page.wait_for_selector("svg .box")
            assert page.locator("svg .outline").count() == 3
