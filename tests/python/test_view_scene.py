"""What there is to see, from results with planted errors."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import planted
from dqslam import _core
from dqslam.io import load_results, read_trajectory, read_true_objects
from dqslam.view import build_scene, rgb
from dqslam.view.picture import draw_image, outlines_in_image


@pytest.fixture
def files(tmp_path):
    return planted.write_planted(tmp_path, drift=0.3)


def look(files, **options):
    return build_scene(
        load_results(files.results),
        groundtruth=read_trajectory(files.groundtruth),
        objects=read_true_objects(files.objects),
        **options,
    )


@pytest.mark.parametrize(("align", "scale"), [("se3", 1.0), ("sim3", 2.0)])
def test_the_truth_is_moved_to_where_the_estimate_is(tmp_path, align, scale):
    scene = look(planted.write_planted(tmp_path, scale=scale), align=align)
    (truth,) = scene.truth
    np.testing.assert_allclose(truth[:, :3], scene.estimate[:, :3], atol=1e-6)
    turn = np.abs(np.sum(truth[:, 3:] * scene.estimate[:, 3:], axis=1))
    np.testing.assert_allclose(turn, 1.0, atol=1e-9)
    centers = [one.center for one in scene.true_objects]
    np.testing.assert_allclose(centers, planted.CENTERS, atol=1e-6)
    for one in scene.true_objects:
        np.testing.assert_allclose(one.semi_axes, planted.SEMI_AXES, rtol=1e-6)


def test_nothing_is_drawn_where_the_truth_is_unknown(files):
    lines = files.groundtruth.read_text().splitlines(keepends=True)
    poses = [line for line in lines if not line.startswith("#")]
    files.groundtruth.write_text("".join(poses[:6] + poses[-7:]))
    assert [len(run) for run in look(files).truth] == [6, 7]


def test_numbers_are_those_of_the_evaluation(files):
    numbers = {one.id: dict(one.numbers) for one in look(files).objects}
    assert numbers[10]["center error"] == "0.02 m"
    assert numbers[11]["size error"] == "10%"
    assert numbers[11]["volume ratio"] == "1.33"
    assert numbers[12]["orientation error"] == "10.0°"
    assert numbers[12]["true id"] == "12"
    assert numbers[99]["truth"] == "no true object matches"
    assert (numbers[10]["boxes"], numbers[11]["boxes"]) == ("20, 5 held out", "20, 5 held out")
    assert (numbers[10]["fit"], numbers[11]["fit"]) == ("0 of 15 used", "15 of 15 used")
    assert numbers[10]["size"] == "0.160 × 0.100 × 0.060 m"


def test_boxes_say_what_became_of_them(files):
    boxes = look(files).boxes
    assert {state: boxes.state.count(state) for state in set(boxes.state)} == {
        "fits": 45,  # 11, 12 and 14 in the 15 images that were not held out
        "misfit": 15,  # 10
        "held out": 20,
        "left out": 20,  # 13, which is not mapped
    }
    assert (np.diff(boxes.pose) >= 0).all()
    assert [state == "left out" for state in boxes.state] == (boxes.object < 0).tolist()


def test_a_class_has_a_color(files):
    scene = look(files)
    colors = {one.class_name: one.color for one in scene.objects}
    assert len(set(colors.values())) == len(colors) == 4
    assert all(colors[one.class_name] == one.color for one in scene.true_objects)
    assert rgb("#d55e00") == (213, 94, 0)


def test_objects_of_one_class_differ_by_themselves(files):
    path = files.results / "map.json"
    content = json.loads(path.read_text())
    for one in content["objects"]:
        one["class_name"] = "cup"
    path.write_text(json.dumps(content))
    assert len({one.color for one in look(files).objects}) == 5


def shape_of(one):
    """Return R diag(a^2) R^T of an ellipsoid, by way of its dual quadric."""
    ellipsoid = _core.ellipsoid_from_axes(one.center, one.semi_axes, one.orientation_xyzw)
    quadric = _core.dual_quadric_matrix(_core.dual_quadric_from_ellipsoid(ellipsoid))
    return np.outer(one.center, one.center) - quadric[:3, :3]


def test_the_spread_is_an_ellipsoid_of_the_covariance(files):
    turn = planted.TURNS[3].as_matrix()
    covariance = turn @ np.diag([0.04, 0.09, 0.01]) @ turn.T
    one = replace(look(files).objects[0], center_covariance=covariance)
    # A point of it is 3 sigma from the center.
    np.testing.assert_allclose(shape_of(one.spread), 9.0 * covariance, atol=1e-12)


def test_spreads_of_poses_are_turned_into_the_world(files):
    """The file has them in the frames of the cameras; the first is exact, and not all are known."""
    results = load_results(files.results)
    results.covariances[:] = np.nan
    results.covariances[0] = 0.0
    results.covariances[5] = np.diag([0.01, 0.04, 0.09, 1.0, 1.0, 1.0])
    (spread,) = build_scene(results).pose_spreads
    turn = Rotation.from_quat(results.poses[5, 3:]).as_matrix()
    np.testing.assert_allclose(spread.center, results.poses[5, :3])
    expected = 9.0 * sum(
        v * np.outer(a, a) for v, a in zip([0.01, 0.04, 0.09], turn.T, strict=True)
    )
    np.testing.assert_allclose(shape_of(spread), expected, atol=1e-12)


def test_outlines_fill_the_boxes_of_what_is_mapped_as_it_is(files):
    """Object 14 is mapped where the boxes saw it: its outline and its box touch on four sides."""
    scene = look(files)
    row = next(k for k, one in enumerate(scene.objects) if one.id == 14)
    for frame in range(len(scene.timestamps)):
        rows, outlines = outlines_in_image(scene, frame)
        outline = outlines[rows.tolist().index(row)]
        (place,) = np.flatnonzero((scene.boxes.pose == frame) & (scene.boxes.object == row))
        touched = np.concatenate([outline.min(axis=0), outline.max(axis=0)])
        np.testing.assert_allclose(touched, scene.boxes.box[place], atol=0.3)


def test_a_picture_has_each_box_and_object_and_escapes_names(files):
    scene = look(files)
    evil = replace(scene.boxes, class_name=tuple("<script>" for _ in scene.boxes.class_name))
    drawn = draw_image(replace(scene, boxes=evil), 0, selected=0)
    rows, _ = outlines_in_image(scene, 0)
    assert drawn.count('class="box"') == 5
    assert drawn.count('class="outline"') == len(rows) >= 4
    assert drawn.count("&lt;script&gt;") == 5
    assert "<script>" not in drawn


def test_what_is_no_ellipsoid_has_a_place_only(files):
    path = files.results / "map.json"
    content = json.loads(path.read_text())
    content["objects"][1] |= {"semi_axes": None, "orientation_xyzw": None}
    path.write_text(json.dumps(content))
    scene = look(files)
    assert scene.objects[1].ellipsoid is None
    assert scene.objects[1].semi_axes is None
    rows, _ = outlines_in_image(scene, 0)
    assert 1 not in rows


def test_true_objects_alone_have_no_place(files):
    objects = read_true_objects(files.objects)
    with pytest.raises(ValueError, match=r"objects.csv: true objects need a true trajectory"):
        build_scene(load_results(files.results), objects=objects)


def test_without_boxes_or_truth(files):
    (files.results / "boxes.csv").unlink()
    results = load_results(files.results)
    scene = build_scene(results)
    assert (len(scene.boxes), scene.truth, scene.true_objects) == (0, (), ())
    length = sum(map(np.linalg.norm, np.diff(results.poses[:, :3], axis=0)))
    shown = {"poses": f"20 over {length:.4g} m", "objects": "5 mapped, 1 not"}
    assert dict(scene.overview) == shown
    assert draw_image(scene, 3).count("<rect") == 0
