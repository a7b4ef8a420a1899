"""What is read from messages of ROS: boxes, lenses."""

from types import SimpleNamespace

import numpy as np

import dqslam as dq
from ros_messages import camera_info, detection

from dqslam_ros.messages import ImageCamera, boxes_of  # isort: skip

CHOICE = {"min_score": 0.5, "border_px": 3.0, "has_ids": False}


def test_boxes_of_a_message():
    camera = ImageCamera.of(dq.Camera(500, 510, 321, 239, 640, 480))
    message = SimpleNamespace(
        detections=[
            detection([10, 20, 110, 220], "cup", older=False),
            detection([-0.5, 20, 60, 220], "cut", older=False),
            detection([10, 20, 110, 220], "weak", older=False, score=0.2),
        ]
    )
    boxes = boxes_of(message, camera, **CHOICE)
    np.testing.assert_allclose(boxes.box, [[10, 20, 110, 220], [-0.5, 20, 60, 220]])
    assert list(boxes.class_name) == ["cup", "cut"]
    np.testing.assert_array_equal(boxes.truncated, [[0, 0, 0, 0], [1, 0, 0, 0]])
    np.testing.assert_array_equal(boxes.object_id, [-1, -1])


def test_a_wide_lens_shows_more_than_its_image_and_boxes_lie_in_that():
    """Equidistant with no coefficients: an angle a from the axis is f a px from the middle."""
    camera = ImageCamera.of_message(camera_info("equidistant", (0.0,) * 4))
    assert camera.raw.has_distortion
    assert camera.wide.width > camera.raw.width
    u, v = 321.0 + 500.0 * 0.5, 239.0  # half a radian to the right of the axis
    message = SimpleNamespace(
        detections=[
            detection([u - 1, v - 1, u + 1, v + 1], "right", older=False),
            detection([320.0, 238.0, 322.0, 240.0], "middle", older=False),
        ]
    )
    boxes = boxes_of(message, camera, **CHOICE)
    right, middle = (boxes.box[:, :2] + boxes.box[:, 2:]) / 2
    np.testing.assert_allclose(
        middle, [321.0 + camera.offset[0], 239.0 + camera.offset[1]], atol=1e-3
    )
    assert abs(right[0] - middle[0] - 500.0 * np.tan(0.5)) < 0.01
    assert camera.wide.cx == 321.0 + camera.offset[0]


def test_boxes_beyond_the_range_of_a_lens_are_left_out():
    """With k1 = -0.4, no ray is further out than at a radius of sqrt(1 / 1.2)."""
    camera = ImageCamera.of(
        dq.Camera(200, 200, 319.5, 239.5, 640, 480, distortion=[-0.4, 0, 0, 0, 0])
    )
    message = SimpleNamespace(
        detections=[
            detection([0.0, 0.0, 60.0, 60.0], "corner", older=False),
            detection([300.0, 200.0, 340.0, 280.0], "middle", older=False),
        ]
    )
    boxes = boxes_of(message, camera, **CHOICE)
    assert list(boxes.class_name) == ["middle"]
    assert boxes.box.shape == (1, 4) and boxes.truncated.shape == (1, 4)
