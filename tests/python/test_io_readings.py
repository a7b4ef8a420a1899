"""What numbers in files mean: forms of boxes, images, poses, times; by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam import _core
from dqslam.io import BoxReading, Readings, Trajectory
from dqslam.io.detections.table import DetectionTable
from dqslam.io.readings import form_of, read_poses_as

SIZE = (640, 480)


def table(*box, columns=("x1", "y1", "x2", "y2")):
    return DetectionTable(
        path="boxes",
        columns=columns,
        line=np.array([2]),
        frame=np.array([0]),
        timestamp=np.array([1500.0]),
        box=np.array([box], dtype=float),
        score=np.array([1.0]),
        class_id=np.array([0]),
        class_name=("cup",),
        track_id=None,
    )


CORNERS = (100.0, 50.0, 140.0, 130.0)  # middle 120, 90; 40 wide, 80 high


@pytest.mark.parametrize(
    ("columns", "read", "form"),
    [
        # corners by the format; the numbers are x y width height, and so on
        (("x1", "y1", "x2", "y2"), (100, 50, 40, 80), "xywh"),
        (("x1", "y1", "x2", "y2"), (120, 90, 40, 80), "cxcywh"),
        (("x1", "y1", "x2", "y2"), (50, 100, 130, 140), "yxyx"),
        # corner and size by the format: the reader has added the size
        (("left", "top", "width", "height"), (100, 50, 240, 180), "xyxy"),
        (("left", "top", "width", "height"), (120, 90, 160, 170), "cxcywh"),
        # middle and size by the format
        (("cx", "cy", "w", "h"), (80, 10, 120, 90), "xywh"),
        (("stamp", "bbox"), (30, -15, 170, 115), "xyxy"),
    ],
)
def test_forms_of_boxes(columns, read, form):
    found = BoxReading(form=form).boxes(table(*read, columns=columns), SIZE)
    np.testing.assert_allclose(found, [CORNERS])


def test_the_form_is_that_of_the_format():
    assert form_of(table(*CORNERS)) == "xyxy"
    assert form_of(table(*CORNERS, columns=("bbox", "image_id"))) == "xywh"
    assert form_of(table(*CORNERS, columns=("file_name", "bbox", "detection_score"))) == "xyxy"
    for edges in ("xmin ymin xmax ymax", "box.x1 box.y1 box.x2 box.y2", "left top right bottom"):
        assert form_of(table(*CORNERS, columns=("stamp", *edges.split()))) == "xyxy"
    assert form_of(table(*CORNERS, columns=("stamp", "bb_left", "bb_width"))) == "xywh"
    np.testing.assert_array_equal(BoxReading().boxes(table(*CORNERS), SIZE), [CORNERS])


@pytest.mark.parametrize(
    ("image", "letterbox", "read"),
    [
        ((320, 240), False, (49.75, 24.75, 69.75, 64.75)),  # (x + 0.5) / 2 - 0.5
        ((1, 1), False, (100.5 / 640, 50.5 / 480, 140.5 / 640, 130.5 / 480)),
        (
            (100, 100),
            False,
            (10050 / 640 - 0.5, 5050 / 480 - 0.5, 14050 / 640 - 0.5, 13050 / 480 - 0.5),
        ),
        ((640, 640), True, (100, 130, 140, 210)),  # bars of 80 px
        ((320, 320), True, (49.75, 64.75, 69.75, 104.75)),
    ],
)
def test_images_of_boxes(image, letterbox, read):
    reading = BoxReading(image=image, letterbox=letterbox)
    np.testing.assert_allclose(reading.boxes(table(*read), SIZE), [CORNERS], atol=1e-9)


def test_poses_of_other_programs():
    """Each is undone: the true pose comes out."""
    true = np.array([[1.0, 2, 3, *Rotation.from_rotvec([0.3, -0.5, 0.2]).as_quat()]])
    times = np.zeros(1)

    def undone(poses, *names):
        found = read_poses_as(Trajectory(times, poses), names).world_from_camera
        return _core.minus(_core.PoseModel.SE3, found, true)

    def with_axes(columns):
        turn = Rotation.from_quat(true[:, 3:]) * Rotation.from_matrix(columns).inv()
        return np.hstack([true[:, :3], turn.as_quat()])

    first = true[:, [0, 1, 2, 6, 3, 4, 5]]
    opengl = with_axes(np.diag([1, -1, -1]))
    # x right is -y of the body, y down is -z, z forward is x
    body = with_axes(np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]]))
    inverse = _core.inverse(_core.PoseModel.SE3, true)
    for found in (
        undone(first, "w_first"),
        undone(opengl, "opengl"),
        undone(body, "body"),
        undone(inverse, "camera_from_world"),
        undone(inverse[:, [0, 1, 2, 6, 3, 4, 5]], "camera_from_world", "w_first"),
    ):
        np.testing.assert_allclose(found, 0, atol=1e-12)


def test_lengths_mounts_and_times():
    pose = np.array([[1000.0, 0, 0, 0, 0, 0, 1]])
    readings = Readings(
        length_scale=0.001, body_from_camera=(0, 0.5, 0, 0, 0, 0, 1), time_scale=1e-3, time_offset=2
    )
    found = readings.trajectory(Trajectory(np.zeros(1), pose)).world_from_camera
    np.testing.assert_allclose(found, [[1, 0.5, 0, 0, 0, 0, 1]])
    assert readings.timed(table(*CORNERS)).timestamp.tolist() == [3.5]
    same = table(*CORNERS)
    assert Readings().timed(same) is same
    assert not Readings().changes_boxes
    assert replace(readings, boxes=BoxReading(form="xywh")).changes_boxes


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: BoxReading(form="xyz"), "box form 'xyz' is none of xyxy, xywh"),
        (lambda: BoxReading(image=(0, 480)), "box image 0x480 is not positive"),
        (lambda: BoxReading(letterbox=True), "a letterbox needs the size of its image"),
        (lambda: Readings(poses=("blender",)), "poses 'blender' are none of w_first"),
        (lambda: Readings(length_scale=0), "length_scale is 0, not positive"),
        (lambda: Readings(time_scale=float("nan")), "time_scale is nan, not positive"),
        (lambda: Readings(time_offset=float("inf")), "time_offset is inf, not finite"),
    ],
)
def test_what_means_nothing_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
