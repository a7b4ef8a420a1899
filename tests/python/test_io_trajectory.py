import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dqslam.io import FileError, read_trajectory, write_trajectory

GOOD = "0 1 2 3 0 0 0 1"


def write(tmp_path, *lines):
    path = tmp_path / "traj.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_reads_comments_blanks_and_any_spacing(tmp_path):
    path = write(tmp_path, "# t tx ...", "", "1.5\t1 2  3 0 0 0 1", "  # more", " 2 4 5 6 0 1 0 0 ")
    times, poses = read_trajectory(path)
    np.testing.assert_array_equal(times, [1.5, 2.0])
    np.testing.assert_array_equal(poses, [[1, 2, 3, 0, 0, 0, 1], [4, 5, 6, 0, 1, 0, 0]])


def test_what_is_written_is_read_back(tmp_path):
    random = np.random.default_rng(0)
    times = 1311868164.363181 + np.cumsum(random.uniform(1e-5, 1, 50))
    poses = np.hstack([random.normal(0, 100, (50, 3)), Rotation.random(50, random).as_quat()])
    write_trajectory(tmp_path / "traj.txt", times, poses)
    read_times, read_poses = read_trajectory(tmp_path / "traj.txt")
    np.testing.assert_array_equal(read_times, times)
    np.testing.assert_allclose(read_poses, poses, rtol=0, atol=1e-8)
    assert [path.name for path in tmp_path.iterdir()] == ["traj.txt"]


def test_rounded_quaternions_become_unit(tmp_path):
    _, poses = read_trajectory(write(tmp_path, "0 0 0 0 0.6453 -0.5498 0.3363 -0.4101"))
    assert np.linalg.norm(poses[0, 3:]) == pytest.approx(1, abs=1e-15)
    assert poses[0, 3] / poses[0, 4] == pytest.approx(0.6453 / -0.5498)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([GOOD, "1 2 3"], r"traj\.txt:2: 3 fields, not 8"),
        ([GOOD, "", "1 1 2 3 0 0 0 1 9"], r"traj\.txt:3: 9 fields, not 8"),
        ([GOOD, "1,1,2,3,0,0,0"], r":2: 7 fields, not 8"),
        (["# no", GOOD, "1 nan 2 3 0 0 0 1"], r":3: tx is not a finite number below"),
        (["1 1 2 3 0 0 0 inf"], r":1: qw is not a finite number below"),
        ([GOOD, "1 1 two 3 0 0 0 1"], r":2: ty is 'two', not a number"),
        ([GOOD, GOOD], r":2: time 0\.0 repeats 0\.0 \(line 1\)"),
        (["5 1 2 3 0 0 0 1", "4 1 2 3 0 0 0 1"], r":2: time 4\.0 goes back from 5\.0"),
        ([GOOD, "1 1 2 3 0 0 0 0"], r":2: quaternion has length 0, not 1"),
        ([GOOD, "1 1 2 3 1 0 0 1"], r":2: quaternion has length 1\.41421, not 1"),
        ([GOOD, "1 1 -1e9 3 0 0 0 1"], r":2: position is further than 1e\+08 m from the origin"),
        (["# nothing"], r"traj\.txt: holds nothing but comments"),
        ([""], r"traj\.txt: is empty"),
    ],
)
def test_bad_lines_are_named(tmp_path, lines, message):
    with pytest.raises(FileError, match=message):
        read_trajectory(write(tmp_path, *lines))


def test_missing_file(tmp_path):
    with pytest.raises(FileError, match=r"none\.txt: no such file"):
        read_trajectory(tmp_path / "none.txt")


def test_repeated_times_can_be_left_out_but_not_turned_back(tmp_path):
    path = write(tmp_path, GOOD, "0 7 7 7 0 0 0 1", "1 1 2 4 0 0 0 1")
    times, poses = read_trajectory(path, repeated_times=True)
    np.testing.assert_array_equal(times, [0, 1])
    np.testing.assert_array_equal(poses[:, 2], [3, 4])
    path = write(tmp_path, "1 1 2 3 0 0 0 1", "1 7 7 7 0 0 0 1", GOOD)
    with pytest.raises(FileError, match=r":3: time 0\.0 goes back from 1\.0 \(line 1\)"):
        read_trajectory(path, repeated_times=True)


def test_an_unwritable_place_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match=r"traj\.txt: cannot be written"):
        write_trajectory(tmp_path / "file" / "traj.txt", [0.0], [[0, 0, 0, 0, 0, 0, 1]])
