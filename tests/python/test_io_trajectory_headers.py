"""Trajectories with headers, in other orders and units, and of other programs."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam.io import FileError, Notes, frame_rate, read_frame_times, read_trajectory

# A turn of 2 atan2(4, 3) about z, at (1, 2, 3).
POSE = [1, 2, 3, 0, 0, 0.8, 0.6]
HZ = frame_rate(10)


def read(tmp_path, text, name="path.txt", **more):
    path = tmp_path / name
    path.write_text(text)
    notes = more.pop("notes", Notes())
    return read_trajectory(path, notes=notes, **more)


@pytest.mark.parametrize(
    "text",
    [
        "# timestamp tx ty tz qw qx qy qz\n5 1 2 3 0.6 0 0 0.8\n",
        "# format: timestamp tx ty tz qw qx qy qz (s, m)\n5 1 2 3 0.6 0 0 0.8\n",
        "# quaternions are w x y z\n5 1 2 3 0.6 0 0 0.8\n",
        "# poses, w-first\n5 1 2 3 0.6 0 0 0.8\n",
        "# t tx ty tz qx qy qz qw id\n5 1 2 3 0 0 0.8 0.6 9\n",
        "# made by hand\n# timestamp tx ty tz qw qx qy qz\n5 1 2 3 0.6 0 0 0.8\n",
        "timestamp,tx,ty,tz,qx,qy,qz,qw\n5,1,2,3,0,0,0.8,0.6\n",
        "time;x;y;z;q_w;q_x;q_y;q_z\n5;1;2;3;0.6;0;0;0.8\n",
        "qx qy qz qw t tx ty tz\n0 0 0.8 0.6 5 1 2 3\n",
        "#timestamp x y z qx qy qz qw id\n5.0 1 2 3 0 0 0.8 0.6 17\n",
        "5.0 1 2 3 0 0 0.8 0.6 17\n",
        "5.0,1,2,3,0,0,0.8,0.6\n",
        "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], "
        "q_RS_y [], q_RS_z []\n5000000000,1,2,3,0.6,0,0,0.8\n",
        "timestamp_ns,px,py,pz,qx,qy,qz,qw\n5000000000,1,2,3,0,0,0.8,0.6\n",
        "t [ms],x [mm],y [mm],z [mm],qx,qy,qz,qw\n5000,1000,2000,3000,0,0,0.8,0.6\n",
        "stamp\tpose.position.x\tpose.position.y\tpose.position.z\tpose.orientation.x\t"
        "pose.orientation.y\tpose.orientation.z\tpose.orientation.w\n5\t1\t2\t3\t0\t0\t.8\t.6\n",
    ],
)
def test_the_header_tells_the_columns(tmp_path, text):
    times, poses = read(tmp_path, text)
    np.testing.assert_allclose(times, [5], rtol=0, atol=1e-12)
    np.testing.assert_allclose(poses, [POSE], rtol=0, atol=1e-12)


def test_what_a_header_leaves_open_is_noted(tmp_path):
    notes = Notes()
    read(tmp_path, "t,tx,ty,tz,qx,qy,qz,qw,vx,vy\n5,1,2,3,0,0,0.8,0.6,9,9\n", notes=notes)
    assert notes.sentences()[0].endswith("path.txt: not used: vx, vy")
    notes = Notes()
    read(tmp_path, "5.0,1,2,3,0,0,0.8,0.6\n", notes=notes)
    assert "no header: the quaternion is read as x y z w" in notes.sentences()[0]
    notes = Notes()
    read(tmp_path, "1403636579763555584.0 1 2 3 0 0 0.8 0.6\n", notes=notes)
    assert "nanoseconds since 1970" in notes.sentences()[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,tx,ty,qx,qy,qz,qw\n5,1,2,0,0,0.8,0.6\n", "its header has no tz"),
        ("t,tx,ty,tz,qx,qy,qz,qw\n", "holds no poses, only a header"),
        (
            "t,tx [in],ty,tz,qx,qy,qz,qw\n5,1,2,3,0,0,0.8,0.6\n",
            "the header gives tx in in, not one",
        ),
        ("t,tx,ty,tz,qx,qy,qz,qw\n5,1,2,3,0,0,0.8\n", r":2: 7 fields, not 8"),
        (
            "timestamp x y z roll pitch yaw\n5 1 2 3 0 0 0.8\n",
            "its header has no qx, qy, qz, qw, but roll, pitch, yaw: angles are not read",
        ),
        ("# time x y theta\n5 1 2 0.8\n", "its header has no tz, qx, .*, but theta: angles"),
        ("t;x;y;z;rx;ry;rz\n5;1;2;3;0;0;0.8\n", "no qx, qy, qz, qw, but rx, ry, rz"),
        # Without a header, eight numbers are a trajectory unless they begin as boxes of MOT do.
        ("0.5 1.25 2 3 0 0 2.4 1.8\n", r":1: quaternion has length 3, not 1"),
        ("0.5,1.25,2,3,0,0,240,180\n", r":1: quaternion has length 300, not 1"),
        ("5 1 200 300 40 30 240 180\n", "trajectory in no known format"),
    ],
)
def test_a_header_that_does_not_fit(tmp_path, text, message):
    with pytest.raises(FileError, match=message):
        read(tmp_path, text)


def test_prose_is_no_header(tmp_path):
    times, poses = read(tmp_path, "# x y z of the camera, qw is last\n5 1 2 3 0 0 0.8 0.6\n")
    np.testing.assert_allclose(poses, [POSE], atol=1e-12)


ROWS = "0.28 0.96 0 1 -0.96 0.28 0 2 0 0 1 3"


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        (f"{ROWS}\n{ROWS} 0 0 0 1\n", None),
        (f"{ROWS} 0 0 0 1\n" * 2, [0, 1]),
        (f"4 {ROWS}\n7 {ROWS}\n", [4, 7]),
        (f"4 {ROWS} 0 0 0 1\n7 {ROWS} 0 0 0 1\n", [4, 7]),
    ],
)
def test_matrices_with_a_last_row_or_a_frame(tmp_path, text, frames):
    if frames is None:
        with pytest.raises(FileError, match=r":2: 16 fields, not the 12 of a 3 x 4 matrix or"):
            read(tmp_path, text, frames=HZ)
        return
    times, poses = read(tmp_path, text, frames=HZ)
    np.testing.assert_allclose(times, np.array(frames) / 10)
    np.testing.assert_allclose(poses[0], [1, 2, 3, 0, 0, -0.6, 0.8], atol=1e-12)


def test_a_matrix_with_another_last_row(tmp_path):
    with pytest.raises(FileError, match="the last row of the matrix is not 0 0 0 1"):
        read(tmp_path, f"{ROWS} 0 0 1 1\n", frames=HZ)


def colmap(*images, points="1.5 2.5 -1 3.5 4.5 77"):
    lines = [
        "# Image list with two lines of data per image:",
        "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME",
        "#   POINTS2D[] as (X, Y, POINT3D_ID)",
    ]
    for number, name, turn, place in images:
        w_first = turn.as_quat()[[3, 0, 1, 2]]
        cells = " ".join(f"{value:.17g}" for value in (*w_first, *place))
        lines += [f"{number} {cells} 1 {name}", points]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("points", ["1.5 2.5 -1 3.5 4.5 77", "", "1 2 3 4 5 6 7 8 9 10 11 12"])
def test_colmap_is_inverted_and_sorted(tmp_path, points):
    turns = Rotation.from_rotvec([[0.1, -0.2, 0.3], [0.5, 0.1, -0.4]])
    centers = np.array([[1, 2, 3], [-4, 5, 6.0]])
    # A point X in the world is R (X - C) in the camera.
    places = -turns.apply(centers)
    images = [(9, "rgb/7.png", turns[1], places[1]), (4, "rgb/6.png", turns[0], places[0])]
    times, poses = read(tmp_path, colmap(*images, points=points), "images.txt", frames=HZ)
    np.testing.assert_allclose(times, [0.6, 0.7])
    np.testing.assert_allclose(poses[:, :3], centers, atol=1e-12)
    apart = Rotation.from_quat(poses[:, 3:]) * turns
    assert apart.magnitude().max() < 1e-12


def test_colmap_images_have_the_times_of_their_names(tmp_path):
    one = Rotation.identity()
    images = [(1, "a.png", one, (0, 0, 0)), (2, "b.png", one, (0, 0, 1))]
    (tmp_path / "rgb.txt").write_text("3.5 a.png\n3.75 b.png\n")
    frames = read_frame_times(tmp_path / "rgb.txt")
    times, poses = read(tmp_path, colmap(*images), "images.txt", frames=frames)
    assert times.tolist() == [3.5, 3.75]
    assert poses[:, 2].tolist() == [0, -1]
    with pytest.raises(FileError, match=r"images\.txt:4: a\.png: its name is no number"):
        read(tmp_path, colmap(*images), "images.txt", frames=HZ)
    timed = [(1, "2.5.png", one, (0, 0, 0)), (2, "2.25.png", one, (0, 0, 1))]
    assert read(tmp_path, colmap(*timed), "images.txt").timestamps.tolist() == [2.25, 2.5]


def test_images_of_two_cameras_are_refused(tmp_path):
    text = colmap((1, "1.png", Rotation.identity(), (0, 0, 0)))
    text += text.split("\n")[3].replace("1 1.png", "2 2.png") + "\n\n"
    with pytest.raises(FileError, match="its images are of 2 cameras, not of one"):
        read(tmp_path, text, "images.txt", frames=HZ)
