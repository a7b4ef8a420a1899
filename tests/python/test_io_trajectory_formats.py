import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import realdata
from dqslam.io import TRAJECTORY_FORMATS, FileError, frame_rate, read_trajectory

FORMATS = {format_.name: format_ for format_ in TRAJECTORY_FORMATS}
# A quarter turn about z, at (1, 2, 3).
TURN = [1, 2, 3, 0, 0, np.sqrt(0.5), np.sqrt(0.5)]
KITTI = "0 -1 0 1 1 0 0 2 0 0 1 3\n"
EUROC_HEADER = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x []\n"
EUROC = f"{EUROC_HEADER}1403636580838555648,1,2,3,{0.5**0.5!r},0,0,{0.5**0.5!r}"


def write(tmp_path, text, name="traj.txt"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def random_path(count=30, start=1403636580.25):
    random = np.random.default_rng(1)
    times = start + 0.05 * np.arange(count)
    turns = Rotation.random(count, random).as_quat(canonical=True)
    return times, np.hstack([np.round(random.normal(0, 50, (count, 3)), 9), turns])


def test_kitti_by_hand(tmp_path):
    times, poses = read_trajectory(write(tmp_path, KITTI * 3), frames=frame_rate(10))
    np.testing.assert_array_equal(times, [0, 0.1, 0.2])
    np.testing.assert_allclose(poses, [TURN] * 3, atol=1e-15)


@pytest.mark.parametrize("more", ["", ",0,0,0,0,0,0,0,0,0"])
def test_euroc_by_hand(tmp_path, more):
    times, poses = read_trajectory(write(tmp_path, EUROC + more + "\n", "data.csv"))
    assert times[0] == 1403636580.838555648
    np.testing.assert_allclose(poses, [TURN], atol=1e-15)


def test_an_euroc_clock_that_starts_at_0_is_named(tmp_path):
    path = write(tmp_path, EUROC.replace("1403636580838555648", "140363658"))
    assert read_trajectory(path, "euroc").timestamps[0] == 0.140363658
    with pytest.raises(FileError, match="trajectory in no known format"):  # a frame of MOT?
        read_trajectory(path)


def test_the_camera_in_the_body(tmp_path):
    # The camera sits 0.1 m ahead of the body on its x, which the turn makes y of the world.
    path = write(tmp_path, EUROC, "data.csv")
    mount = [0.1, 0, 0, *Rotation.from_euler("x", -90, degrees=True).as_quat()]
    _, poses = read_trajectory(path, body_from_camera=mount)
    np.testing.assert_allclose(poses[0, :3], [1, 2.1, 3], atol=1e-15)
    expected = Rotation.from_euler("z", 90, degrees=True) * Rotation.from_quat(mount[3:])
    np.testing.assert_allclose(
        Rotation.from_quat(poses[0, 3:]).as_matrix(), expected.as_matrix(), atol=1e-15
    )


@pytest.mark.parametrize("name", ["tum", "kitti", "euroc"])
def test_what_is_written_is_read_back(tmp_path, name):
    start = 0 if name == "kitti" else 1403636580.25
    times, poses = random_path(start=start)
    path = tmp_path / "there.txt"
    FORMATS[name].write(path, times, poses)
    read_times, read_poses = read_trajectory(path, frames=frame_rate(20))
    np.testing.assert_allclose(read_times, times, rtol=0, atol=1e-15)
    np.testing.assert_allclose(read_poses, poses, rtol=0, atol=1e-9)


def test_tum_and_euroc_come_back_to_the_digit(tmp_path):
    times, poses = random_path()
    for name, other in (("tum", "euroc"), ("euroc", "tum")):
        first, there, back = (tmp_path / f"{name}_{i}.txt" for i in range(3))
        FORMATS[name].write(first, times, poses)
        FORMATS[other].write(there, *read_trajectory(first))
        FORMATS[name].write(back, *read_trajectory(there))
        assert back.read_text() == first.read_text()


@pytest.mark.parametrize("name", ["tum", "kitti"])
def test_matrices_come_back_to_a_billionth(tmp_path, name):
    """A quaternion's last digit has no counterpart in a matrix."""
    times, poses = random_path()
    other = {"tum": "kitti", "kitti": "tum"}[name]
    first, there, back = (tmp_path / f"{i}.txt" for i in range(3))
    FORMATS[name].write(first, times, poses)
    FORMATS[other].write(there, *read_trajectory(first, frames=frame_rate(20)))
    FORMATS[name].write(back, *read_trajectory(there, frames=frame_rate(20)))
    columns = slice(1, None) if name == "tum" else slice(None)
    np.testing.assert_allclose(
        np.loadtxt(back)[:, columns], np.loadtxt(first)[:, columns], rtol=0, atol=2.1e-9
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (KITTI + "1 2 3\n", r"traj\.txt:2: 3 fields, not the 12 of a 3 x 4 matrix"),
        (KITTI + KITTI.replace("3", "nan"), r":2: tx is not a finite number below"),
        (KITTI + KITTI.replace("-1", "1"), r":2: the 3 x 3 part is no rotation .*determinant -1"),
        (KITTI.replace("-1", "-1.1"), r":1: the 3 x 3 part is no rotation \(R R' differs .* 0\.21"),
        (
            EUROC + "\n1.5e9" + EUROC[EUROC.index(",1,2") :],
            r":3: time is '1\.5e9', not a whole num",
        ),
        (EUROC + "\n1403636580838555649,1,2", r":3: 3 fields, not 8 or more alike"),
        (EUROC + "\n1403636581838555648,1,2,3,1,1,0,0", r":3: quaternion has length 1\.414"),
        (EUROC + "\n1403636580838555648,1,2,3,1,0,0,0", r":3: time 1403636580\.8385556 repeats"),
    ],
)
def test_bad_lines_are_named(tmp_path, text, message):
    path = write(tmp_path, text)
    with pytest.raises(FileError, match=message):
        read_trajectory(path, frames=frame_rate(1))


def test_kitti_needs_times(tmp_path):
    with pytest.raises(FileError, match="kitti has no times: .*--frame-times FILE or --frame-rate"):
        read_trajectory(write(tmp_path, KITTI))


def test_formats_by_name(tmp_path):
    path = write(tmp_path, "0 1 2 3 0 0 0 1\n")
    assert len(read_trajectory(path, "tum").timestamps) == 1
    with pytest.raises(FileError, match=r":1: 8 fields, not the 12"):
        read_trajectory(path, "kitti", frames=frame_rate(1))
    with pytest.raises(
        ValueError,
        match="'coco' is none of trajectory formats: rosbag, colmap-images, euroc",
    ):
        read_trajectory(path, "coco")
    with pytest.raises(ValueError, match="topic /odom: only bags have topics, not tum"):
        read_trajectory(path, topic="/odom")


def test_a_real_kitti_trajectory():
    folder = realdata.recording("kitti_tracking") / "0005"
    path = folder / "poses_orbslam3_stereo_kitti3x4.txt"
    times, poses = read_trajectory(path, frames=frame_rate(10))
    true_times, true_poses = read_trajectory(folder / "trajectory_reference.txt")
    np.testing.assert_allclose(times, true_times, rtol=0, atol=1e-12)
    np.testing.assert_allclose(poses[:, :3], true_poses[:, :3], rtol=0, atol=1e-6)
    apart = Rotation.from_quat(poses[:, 3:]).inv() * Rotation.from_quat(true_poses[:, 3:])
    assert apart.magnitude().max() < 1e-6
