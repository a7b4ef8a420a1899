"""Cameras in maps that are a table of objects."""

import numpy as np
import pytest

import dqslam as dq
from dqslam.places import read_landmarks
from small_place import AXES, CENTERS, LENS, NAMES, boxes_at, detections_of, pose_at


def write_csv(path, columns, rows):
    path.write_text("\n".join([columns, *rows]) + "\n")
    return path


@pytest.fixture
def table(tmp_path):
    """The objects of the small place with full sizes, but without their orientation."""
    rows = []
    for name, center in zip(NAMES, CENTERS.tolist(), strict=True):
        sizes = [2.0 * axis for axis in AXES[name]]
        rows.append(",".join([name, *(f"{number:g}" for number in (*center, *sizes))]))
    return write_csv(tmp_path / "map.csv", "class_name,x,y,z,sx,sy,sz", rows)


def test_a_camera_is_found_among_spheres(table):
    pose = pose_at(1.3, -2.2, 0.9)
    found = dq.locate(table, detections_of(boxes_at(pose)), LENS)
    assert found.is_found, found.reason
    error = np.linalg.norm(found.pose[:3] - pose[:3])
    assert error < 0.2
    assert error < 4.0 * np.sqrt(np.trace(found.covariance[:3, :3]))
    np.testing.assert_array_equal(found.object_id, np.arange(len(NAMES)))


def test_a_sphere_is_as_uncertain_as_its_axes_differ(table):
    place = dq.PlaceMap.of_landmarks(read_landmarks(table))
    logs = np.log([AXES[name] for name in NAMES])
    np.testing.assert_allclose(place.size[:, 0], logs.mean(axis=1), atol=1e-9)
    flat = np.argmax(logs.std(axis=1))
    assert place.size[flat, 1] == place.size[:, 1].max()


def test_objects_without_sizes_have_no_distance(tmp_path):
    path = write_csv(tmp_path / "points.csv", "class_id,x,y,z", ["1,0,0,0", "2,1,0,0"])
    with pytest.raises(ValueError, match=r"points.csv: no object has a size"):
        dq.locate(path, detections_of(boxes_at(pose_at(1.0, 1.0, 1.0))), LENS)
