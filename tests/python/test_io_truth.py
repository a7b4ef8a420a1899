import numpy as np
import pytest

import realdata
from dqslam import Camera
from dqslam.io import FileError, read_true_boxes, read_true_objects
from dqslam.lens import undistort_boxes

HALF = np.sqrt(0.5)


def write(folder, text):
    path = folder / "objects.csv"
    path.write_text(text)
    return path


def test_our_own_columns(tmp_path):
    path = write(
        tmp_path,
        "# a comment\n"
        "class_name,x,y,z,qx,qy,qz,qw,sx,sy,sz,static,object_id,color\n"
        f"cup,1,2,3,0,0,{HALF:.4f},{HALF:.4f},0.1,0.2,0.3,1,7,red\n"
        '"box, big",4,5,6,0,0,0,1,1,2,3,0,9,blue\n',
    )
    found = read_true_objects(path)
    assert len(found) == 2
    np.testing.assert_array_equal(found.id, [7, 9])
    assert found.class_name == ("cup", "box, big")
    np.testing.assert_array_equal(found.center, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_allclose(found.rotation[0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_array_equal(found.size, [[0.1, 0.2, 0.3], [1, 2, 3]])
    np.testing.assert_array_equal(found.static, [True, False])


def test_centers_are_enough(tmp_path):
    found = read_true_objects(write(tmp_path, "x,y,z\n1,2,3\n"))
    assert (found.id, found.class_name, found.rotation, found.size) == (None,) * 4
    np.testing.assert_array_equal(found.static, [True])


def test_yaw_is_about_z_and_kittis_about_y(tmp_path):
    ours = read_true_objects(write(tmp_path, f"x,y,z,yaw,sx,sy,sz\n0,0,0,{np.pi / 2},1,2,3\n"))
    np.testing.assert_allclose(ours.rotation[0] @ [1, 0, 0], [0, 1, 0], atol=1e-12)
    text = f"cx,cy,cz,length,height,width,yaw\n0,0,0,4,1.5,1.6,{np.pi / 2}\n"
    kitti = read_true_objects(write(tmp_path, text))
    # R = [[c, 0, s], [0, 1, 0], [-s, 0, c]]: the length, along x, looks along -z.
    np.testing.assert_allclose(kitti.rotation[0] @ [1, 0, 0], [0, 0, -1], atol=1e-12)
    np.testing.assert_array_equal(kitti.size, [[4, 1.5, 1.6]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y\n1,2\n", r"objects.csv: no columns x, y, z \(it has: x, y\)"),
        ("x,y,z\n", "objects.csv: holds no rows, only a header"),
        ("x,y,z\n1,2,3\n1,nan,3\n", "objects.csv:3: y is nan, not a finite number below"),
        ("x,y,z\n1,,3\n", "objects.csv:2: y is empty"),
        ("x,y,z,x\n1,2,3,4\n", "objects.csv:1: 2 columns are named x"),
        ("x,y,z\n# here\n1,2\n", "objects.csv:3: 2 fields, but 3 columns"),
        ("id,x,y,z\n1,0,0,0\n2,0,0,0\n1,0,0,0\n", "objects.csv:4: object 1 occurs twice"),
        ("id,x,y,z\n1.5,0,0,0\n", "objects.csv:2: id is 1.5, not a whole number"),
        ("x,y,z,sx,sy,sz\n0,0,0,1,0,1\n", "objects.csv:2: sx sy sz: a size is not positive"),
        ("x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,2\n", "objects.csv:2: the quaternion is not of length 1"),
        ("x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1e38\n", "objects.csv:2: the quaternion is not of"),
        ("x,y,z,yaw,sx,sy,sz\n0,0,0,1e38,1,1,1\n", "objects.csv:2: yaw 1e38 is no angle"),
        ("x,y,z,static\n0,0,0,yes\n", "objects.csv:2: static is 'yes', not a number"),
        ("x,y,z,static\n0,0,0,2\n", "objects.csv:2: static is 2, not 0 or 1"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, message):
    with pytest.raises(FileError, match=message):
        read_true_objects(write(tmp_path, text))


CAMERA = Camera(500, 500, 320, 240, 640, 480)
BOXES = "timestamp,x1,y1,x2,y2,track_id\n0.5,1,2,30,40,7\n0.6,1,2,30,40,\n"


def test_boxes(tmp_path):
    found = read_true_boxes(write(tmp_path, BOXES), CAMERA)
    np.testing.assert_array_equal(found.timestamp, [0.5, 0.6])
    np.testing.assert_array_equal(found.box, [[1, 2, 30, 40]] * 2)
    np.testing.assert_array_equal(found.object_id, [7, -1])


def test_boxes_are_undistorted(tmp_path):
    lens = Camera(500, 500, 320, 240, 640, 480, distortion=[0.2, 0, 0, 0, 0])
    found = read_true_boxes(write(tmp_path, BOXES), lens)
    np.testing.assert_allclose(found.box, undistort_boxes(lens, [[1, 2, 30, 40]] * 2))


def test_the_column_of_ids_is_named(tmp_path):
    path = write(tmp_path, BOXES.replace("track_id", "mine"))
    np.testing.assert_array_equal(read_true_boxes(path, CAMERA, "mine").object_id, [7, -1])
    with pytest.raises(FileError, match=r"objects.csv:1: no column track_id \(it has: timest"):
        read_true_boxes(path, CAMERA)
    path = write(tmp_path, BOXES.replace("0.5,1", "0.5,30"))
    with pytest.raises(FileError, match="objects.csv:2: empty box: x1 < x2, y1 < y2"):
        read_true_boxes(path, CAMERA)


def test_real_objects_are_read_as_they_are():
    found = read_true_objects(realdata.recording("bop_lmo") / "seg_0703_1001" / "objects_gt.csv")
    np.testing.assert_array_equal(found.id, [1, 5, 6, 8, 9, 10, 11, 12])
    np.testing.assert_array_equal(found.static, [0, 1, 1, 1, 0, 1, 1, 1])
    np.testing.assert_array_equal(found.size[3], [0.22948, 0.07547, 0.20800])
    np.testing.assert_allclose(found.rotation[3], np.eye(3), atol=1e-12)
    found = read_true_objects(
        realdata.recording("kitti_tracking") / "0005" / "objects_gt_world.csv"
    )
    assert (len(found), found.static.sum(), found.class_name[11]) == (36, 18, "Van")
    np.testing.assert_array_equal(found.size[0], [3.542, 1.716, 1.628])
    np.testing.assert_array_equal(found.center[0], [-21.284, 0.898, 47.412])
    # Parked along the road, which leads along z.
    np.testing.assert_allclose(found.rotation[0] @ [1, 0, 0], [0, 0, 1], atol=0.05)
