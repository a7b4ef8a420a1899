"""Figures of results with planted errors: what is drawn, and where."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("matplotlib")

import planted
import scenes
from dqslam import io
from dqslam.evaluation import fit_boxes, pose_errors
from dqslam.metrics import align_poses
from dqslam.plot import plot_results
from dqslam.plot.above import from_above, outline
from dqslam.plot.boxes import draw_worst_and_median
from dqslam.plot.errors import draw_errors
from dqslam.plot.gaps import break_at_gaps
from dqslam.plot.path_error import draw_path_error
from dqslam.plot.residuals import draw_residuals
from dqslam.plot.results_map import MapTruth, draw_results_map

SIGNATURES = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return planted.write_planted(tmp_path_factory.mktemp("planted"), drift=0.3)


@pytest.fixture(scope="module")
def results(files):
    """Return results whose poses have a sigma of 1 cm and 1 mrad, and objects of 2 cm."""
    found = io.load_results(files.results)
    covariance = np.tile(np.diag([1e-4] * 3 + [1e-6] * 3), (planted.POSES, 1, 1))
    spread = np.tile(4e-4 * np.eye(3), (len(found.objects), 1, 1))
    objects = replace(found.objects, center_covariances=spread)
    return replace(found, covariances=covariance, objects=objects)


@pytest.fixture(scope="module")
def truth(files):
    return io.read_trajectory(files.groundtruth)


def lines(axes, kind):
    return [np.array(one.get_xydata()) for one in axes.lines if one.get_gid() == kind]


def map_truth(results, truth, files=None):
    poses = truth.world_from_camera
    alignment = align_poses(results.poses, poses, lever=1.0)
    objects = None if files is None else io.read_true_objects(files.objects)
    return MapTruth(truth.timestamps, poses, objects, alignment)


def test_the_view_from_above_of_a_street_has_its_length_across():
    view = from_above(scenes.street_poses())
    assert view.labels == ("z [m]", "x [m]")
    assert view.downward  # seen from above, x to the right of z is down the paper
    np.testing.assert_array_equal(view.points(np.array([[1.0, 2.0, 3.0]])), [[3.0, 1.0]])


def test_without_a_path_the_view_from_above_is_along_z():
    view = from_above(np.zeros((0, 7)))
    np.testing.assert_array_equal(view.axes, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    assert (view.labels, view.downward) == (("x [m]", "y [m]"), False)


def test_the_view_from_above_of_a_table():
    poses = scenes.orbit_poses()
    poses[:, 0] *= 2.0
    view = from_above(poses)
    assert (view.labels, view.downward) == (("x [m]", "y [m]"), False)
    shadow = view.outline(np.array([1.0, 2.0, 3.0]), np.diag([0.25, 0.04, 9.0]))
    np.testing.assert_allclose(shadow.min(axis=1), [0.5, 1.8])
    np.testing.assert_allclose(shadow.max(axis=1), [1.5, 2.2])


def test_a_flat_ellipse_is_a_line():
    np.testing.assert_allclose(outline(np.zeros(2), np.diag([4.0, -1e-18]))[1], 0.0)


def test_no_line_crosses_a_gap():
    times, values = break_at_gaps(np.array([0.0, 1, 2, 30, 31]), np.arange(10.0).reshape(5, 2))
    np.testing.assert_array_equal(np.isnan(times), [0, 0, 0, 1, 0, 0])
    np.testing.assert_array_equal(np.isnan(values[:, 1]), [0, 0, 0, 1, 0, 0])
    assert [len(part) for part in break_at_gaps(np.zeros(1), np.zeros((1, 2)))] == [1, 1]


def test_the_map_has_every_object_where_it_is(results):
    figure = draw_results_map(results)
    (axes,) = figure.axes
    view = from_above(results.poses)
    outlines = lines(axes, "object")
    assert len(outlines) == len(results.objects) == 5
    for row, one in enumerate(outlines):
        middle = view.points(results.objects.centers[[row]])[0]
        np.testing.assert_allclose(one[:-1].mean(axis=0), middle, atol=1e-9)
    (path,) = lines(axes, "estimate")
    np.testing.assert_allclose(path, view.points(results.poses[:, :3]))
    (odometry,) = lines(axes, "odometry")
    np.testing.assert_allclose(odometry, view.points(results.initial_poses[:, :3]))
    assert not lines(axes, "truth")


def test_covariances_are_circles_of_two_sigmas(results):
    (axes,) = draw_results_map(results).axes
    for kind, sigma, count in (("object covariance", 0.02, 5), ("pose covariance", 0.01, 12)):
        circles = lines(axes, kind)
        assert len(circles) == count
        for one in circles:
            radii = np.linalg.norm(one - one[:-1].mean(axis=0), axis=1)
            np.testing.assert_allclose(radii, 2.0 * sigma, rtol=1e-6)


def test_unknown_covariances_are_not_drawn(results):
    objects = replace(results.objects, center_covariances=np.full((5, 3, 3), np.nan))
    unknown = replace(
        results, objects=objects, covariances=np.full_like(results.covariances, np.nan)
    )
    (axes,) = draw_results_map(unknown).axes
    assert not lines(axes, "object covariance")
    assert not lines(axes, "pose covariance")


def test_with_the_truth_the_map_is_in_its_world(files, results, truth):
    (axes,) = draw_results_map(results, map_truth(results, truth, files)).axes
    view = from_above(truth.world_from_camera)
    (path,), (true_path,) = lines(axes, "estimate"), lines(axes, "truth")
    np.testing.assert_allclose(path, true_path, atol=1e-6)
    np.testing.assert_allclose(true_path, view.points(truth.world_from_camera[:, :3]))
    # Filled: the mapped objects, and those of the truth that stand still.
    assert len(axes.patches) == 5 + 5
    named = zip(results.objects.object_ids, lines(axes, "object"), strict=True)
    (perfect,) = [one for number, one in named if number == 14]
    center = planted.TURN.apply(planted.CENTERS[4]) + planted.SHIFT
    np.testing.assert_allclose(perfect[:-1].mean(axis=0), view.points(center[None])[0], atol=1e-6)


def test_an_object_that_is_no_ellipsoid_is_a_cross(results):
    axes_ = results.objects.semi_axes.copy()
    axes_[1] = np.nan
    objects = replace(results.objects, semi_axes=axes_)
    (axes,) = draw_results_map(replace(results, objects=objects)).axes
    crosses = [one for one in axes.lines if one.get_marker() == "x"]
    assert [len(one.get_xydata()) for one in crosses] == [1]


def test_names_do_not_cover_each_other(results):
    figure = draw_results_map(results)
    (axes,) = figure.axes
    assert {one.get_text() for one in axes.texts} <= {"cup 10", "book", "lamp", "box", "cup 99"}
    boxes = [one.get_window_extent() for one in axes.texts]
    assert len(boxes) >= 4
    for row, one in enumerate(boxes):
        assert not any(one.overlaps(other) for other in boxes[row + 1 :])


def test_a_diverged_odometry_does_not_shrink_the_map(results):
    far = results.initial_poses.copy()
    far[:, :2] += 1e5
    (axes,) = draw_results_map(replace(results, initial_poses=far)).axes
    assert np.ptp(axes.get_xlim()) < 10.0


def test_errors_and_their_band(results, truth):
    poses = results.poses.copy()
    poses[7, :3] += planted.TURN.inv().apply([0.03, 0.0, 0.0])
    errors = pose_errors(replace(results, poses=poses), truth)
    figure = draw_errors(errors, "position")
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "distance [m]", "x [m]", "y [m]", "z [m]"
    ]  # fmt: skip
    along_x = figure.axes[1]
    (line,) = lines(along_x, "estimate")
    assert line[7, 1] == pytest.approx(0.03, abs=1e-6)
    (band,) = along_x.collections
    assert band.get_datalim(along_x.transData).height == pytest.approx(2 * 3 * 0.01)
    (distance,), (odometry,) = (lines(figure.axes[0], kind) for kind in ("estimate", "odometry"))
    np.testing.assert_allclose(distance[:, 1], errors.distance)
    np.testing.assert_allclose(odometry[:, 1], errors.odometry_distance)


def test_rotations_are_in_degrees(results, truth):
    errors = pose_errors(results, truth)
    errors = replace(errors, rotation=np.full((planted.POSES, 3), np.radians(2.0)))
    figure = draw_errors(errors, "rotation")
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "about x [°]",
        "about y [°]",
        "about z [°]",
    ]
    (line,) = lines(figure.axes[2], "estimate")
    np.testing.assert_allclose(line[:, 1], 2.0)


def test_a_planar_robot_has_no_panel_for_what_cannot_differ(results, truth):
    errors = pose_errors(results, truth)
    rotation = np.zeros((planted.POSES, 3))
    rotation[:, 2] = 0.01
    figure = draw_errors(replace(errors, rotation=rotation), "rotation")
    assert [axes.get_ylabel() for axes in figure.axes] == ["about z [°]"]


def test_the_histograms_hold_every_box(results):
    fits = fit_boxes(results)
    residual = np.full_like(fits.residual, 1.0)
    residual[0] = 20.0  # beyond: still counted, in the last bin
    held_out = np.zeros(len(residual), dtype=bool)
    fits = replace(fits, residual=residual, boxes=replace(fits.boxes, held_out=held_out))
    left, right = draw_residuals(fits).axes
    for axes in (left, right):
        area = sum(bar.get_height() * bar.get_width() for bar in axes.patches)
        assert area == pytest.approx(1.0)
    heights = {bar.get_x(): bar.get_height() for bar in left.patches}
    assert heights[4.0] == pytest.approx(1.0 - 1.0 / len(residual))
    assert heights[19.0] == pytest.approx(1.0 / len(residual))


def test_the_expected_curve_is_a_chi_square_with_four_degrees(results):
    left, right = draw_residuals(fit_boxes(results)).axes
    (curve,) = lines(left, "expected")
    np.testing.assert_allclose(curve[:, 1], curve[:, 0] / 4.0 * np.exp(-curve[:, 0] / 2.0))
    (bell,) = lines(right, "expected")
    assert bell[:, 1].max() == pytest.approx(1.0 / np.sqrt(2.0 * np.pi), rel=1e-3)


def test_outlines_touch_the_boxes_of_worst_and_median(results):
    fits = fit_boxes(results)
    figure = draw_worst_and_median(results, fits)
    poses, overlaps = fits.frames()
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    middle = len(poses) // 2
    assert titles == [
        f"worst: pose {poses[0]}, mean IoU {overlaps[0]:.2f}",
        f"median: pose {poses[middle]}, mean IoU {overlaps[middle]:.2f}",
    ]
    for axes, pose in zip(figure.axes, poses[[0, middle]], strict=True):
        rows = (fits.boxes.pose == pose) & (fits.object_row >= 0)
        drawn = lines(axes, "outline")
        assert len(drawn) == len(lines(axes, "detected")) == rows.sum() == 4
        assert len(lines(axes, "not mapped")) == 1
        touched = [np.concatenate([one.min(axis=0), one.max(axis=0)]) for one in drawn]
        for box in fits.predicted[rows]:
            assert min(np.abs(one - box).max() for one in touched) < 0.5
        for box in fits.boxes.box[rows]:
            edges = [
                np.concatenate([o.min(axis=0), o.max(axis=0)]) for o in lines(axes, "detected")
            ]
            assert min(np.abs(one - box).max() for one in edges) < 1e-9


@pytest.mark.parametrize("kind", ["svg", "png", "pdf"])
def test_all_figures_in_each_format(tmp_path, files, results, truth, kind):
    objects = io.read_true_objects(files.objects)
    shares = []
    drawn = plot_results(
        results,
        tmp_path / "new",
        kind=kind,
        groundtruth=truth,
        objects=objects,
        progress=shares.append,
    )
    assert shares == [number / 6 for number in range(1, 7)]
    names = ["boxes", "map", "path_error", "position_error", "residuals", "rotation_error"]
    assert [path.name for path in drawn.written] == [f"{name}.{kind}" for name in names]
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == [
        f"{name}.{kind}" for name in names
    ]
    assert all(path.read_bytes().startswith(SIGNATURES[kind]) for path in drawn.written)
    assert drawn.left_out == {}


def test_the_same_results_are_the_same_files(tmp_path, results):
    for folder in ("a", "b"):
        plot_results(results, tmp_path / folder)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_what_cannot_be_drawn_is_said(tmp_path, results):
    drawn = plot_results(replace(results, boxes=None), tmp_path)
    assert [path.name for path in drawn.written] == ["map.svg"]
    assert set(drawn.left_out) == {
        "boxes",
        "residuals",
        "path_error",
        "position_error",
        "rotation_error",
    }
    nothing = replace(results.boxes, object_id=np.full(len(results.boxes), -1))
    drawn = plot_results(replace(results, boxes=nothing), tmp_path)
    assert drawn.left_out["boxes"] == "no box shows an object of the map"


def test_nothing_is_written_when_something_fails(tmp_path, results, truth):
    late = io.Trajectory(truth.timestamps + 1e6, truth.world_from_camera)
    with pytest.raises(ValueError, match="groundtruth: 0 poses within"):
        plot_results(results, tmp_path / "out", groundtruth=late)
    assert not (tmp_path / "out").exists()
    with pytest.raises(io.FileError, match=r"its name ends in none of .svg, .png, .pdf"):
        plot_results(results, tmp_path / "out", kind="bmp")
    assert not (tmp_path / "out").exists()


def test_an_unmoved_world_without_objects(tmp_path, results):
    none = np.zeros(0, dtype=int)
    objects = io.MapObjects(
        object_ids=none,
        class_names=(),
        centers=np.zeros((0, 3)),
        semi_axes=np.zeros((0, 3)),
        orientations=np.zeros((0, 4)),
        dual_quadrics=np.zeros((0, 9)),
        observations=none,
        center_covariances=np.zeros((0, 3, 3)),
        log_semi_axes_sigmas=np.zeros((0, 3)),
    )
    figure = draw_results_map(replace(results, objects=objects))
    assert not lines(figure.axes[0], "object")


def test_the_path_has_the_color_of_its_error(files, results, truth):
    """Each piece has the mean error of its ends; a pose 3 cm off is found in two of them."""
    poses = results.poses.copy()
    poses[7, :3] += planted.TURN.inv().apply([0.03, 0.0, 0.0])
    moved = replace(results, poses=poses)
    errors = pose_errors(moved, truth, align="none")
    figure = draw_path_error(map_truth(results, truth, files), poses[:, :3], errors.distance)
    (colored,) = [one for one in figure.axes[0].collections if one.get_gid() == "error"]
    assert len(colored.get_segments()) == len(poses) - 1
    middle = (errors.distance[1:] + errors.distance[:-1]) / 2
    np.testing.assert_allclose(colored.get_array(), middle)
    assert colored.get_clim() == (0.0, errors.distance.max())
    view = from_above(truth.world_from_camera)
    end = view.points(truth.world_from_camera[-1:, :3])[0]
    np.testing.assert_allclose(colored.get_segments()[-1][1], end, atol=1e-6)
