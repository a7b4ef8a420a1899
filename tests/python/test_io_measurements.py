"""Files of positions, absolute positions and loop closures, and what is wrong in them."""

import numpy as np
import pytest

from dqslam.io import FileError, read_absolute, read_closures, read_positions

TIMES = np.array([10.0, 10.5, 11.0, 11.5])
UPPER = "c11,c12,c13,c22,c23,c33"


def write(tmp_path, text):
    path = tmp_path / "m.csv"
    path.write_text(text)
    return path


def test_positions_by_row_and_by_time(tmp_path):
    path = write(tmp_path, f"# a\nobject,pose,x,y,z,{UPPER}\n7,2,1,2,3,0.04,0.01,0,0.09,0,0.01\n")
    found = read_positions(path, TIMES)
    assert (found.pose.tolist(), found.object_id.tolist()) == ([2], [7])
    assert found.object_in_robot.tolist() == [[1, 2, 3]]
    expected = [[[0.04, 0.01, 0], [0.01, 0.09, 0], [0, 0, 0.01]]]
    np.testing.assert_array_equal(found.covariance, expected)
    path = write(tmp_path, "timestamp,object,x,y,z,sigma\n10.6,7,1,2,3,0.1\n11.3,8,1,2,3,0.2\n")
    found = read_positions(path, TIMES)
    assert found.pose.tolist() == [1, 3]
    np.testing.assert_allclose(found.covariance, [0.01 * np.eye(3), 0.04 * np.eye(3)])


def test_absolute_positions(tmp_path):
    found = read_absolute(write(tmp_path, "pose,x,y,z,sigma\n0,1,2,3,0.5\n"), TIMES)
    assert (found.pose.tolist(), found.position.tolist()) == ([0], [[1, 2, 3]])
    np.testing.assert_array_equal(found.covariance, [0.25 * np.eye(3)])


def test_closures(tmp_path):
    names = "from_timestamp,to_timestamp,x,y,z,qx,qy,qz,qw,sigma_translation,sigma_rotation"
    text = f"{names}\n11.5,10,1,2,3,0,0,0.6,0.8,0.1,0.02\n"
    found = read_closures(write(tmp_path, text), TIMES)
    assert (found.from_pose.tolist(), found.to_pose.tolist()) == ([3], [0])
    np.testing.assert_allclose(found.relative, [[1, 2, 3, 0, 0, 0.6, 0.8]])
    np.testing.assert_allclose(np.diag(found.covariance[0]), [0.01] * 3 + [4e-4] * 3)


POSITION = "pose,object,x,y,z,sigma\n"
CLOSURE = "from_pose,to_pose,x,y,z,qx,qy,qz,qw,sigma_translation,sigma_rotation\n"


@pytest.mark.parametrize(
    ("read", "text", "message"),
    [
        (read_positions, "pose,x,y,z,sigma\n0,1,2,3,1\n", r"m.csv:1: no column object"),
        (read_positions, POSITION + "4,1,0,0,1,1\n", r":2: pose is 4, but there are 4 poses"),
        (read_positions, POSITION + "0,-1,0,0,1,1\n", r":2: object is -1, not an id"),
        (read_positions, POSITION + "0,1,0,0,1,0\n", r":2: sigma is 0, not positive"),
        (read_positions, POSITION + "0,1,0,nan,1,1\n", r":2: y is nan, not a finite number below"),
        (
            read_absolute,
            "x,y,z,sigma\n1,2,3,1\n",
            r":1: needs a column pose or timestamp",
        ),
        (
            read_absolute,
            "pose,timestamp,x,y,z,sigma\n0,0,1,2,3,1\n",
            r"has both",
        ),
        (
            read_absolute,
            "timestamp,x,y,z,sigma\n12,1,2,3,1\n",
            r":2: timestamp is 12, further",
        ),
        (read_absolute, "pose,x,y,z\n0,1,2,3\n", r"needs c11 to c33, or sigma; has neither"),
        (read_absolute, "pose,x,y,z,c11,c22\n0,1,2,3,1,1\n", r"no column c12, c13, c23, c33"),
        (
            read_absolute,
            f"pose,x,y,z,{UPPER}\n0,1,2,3,1,0,0,1,0,1\n1,1,2,3,1,2,0,1,0,1\n",
            r":3: the covariance is not positive definite",
        ),
        (read_closures, CLOSURE + "1,1,0,0,0,0,0,0,1,1,1\n", r":2: both ends are of the same"),
        (read_closures, CLOSURE + "1,2,0,0,0,0,0,0,2,1,1\n", r":2: the quaternion is not of len"),
        (read_closures, CLOSURE + "1,9,0,0,0,0,0,0,1,1,1\n", r":2: to_pose is 9, but there are"),
        (read_closures, CLOSURE + "1,2,0,0,0,0,0,0,1,1,-1\n", r":2: sigma_rotation is -1, not"),
    ],
)
def test_wrong_files(tmp_path, read, text, message):
    with pytest.raises(FileError, match=message):
        read(write(tmp_path, text), TIMES)
