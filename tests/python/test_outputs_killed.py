"""Results whose process is killed at any point, or whose disk is full: old or new, never mixed."""

import os
import resource
import signal
import sys

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core, _exchange, _outputs

OLD, NEW = 0.0, 1.0


def estimate(number):
    """Return an estimate whose every file tells its number."""
    poses = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (3, 1))
    poses[:, 0] = number
    ellipsoid = np.array([number, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    return dq.Estimate(
        pose_model=dq.PoseModel.SE3,
        camera=dq.Camera(500.0 + number, 500.0, 320.0, 240.0, 640, 480),
        timestamps=np.arange(3) + number,
        poses=poses,
        initial_poses=poses,
        object_ids=np.array([int(number)]),
        class_names=("cup",),
        observations=np.array([3]),
        dual_quadrics=_core.dual_quadric_from_ellipsoid(ellipsoid)[None],
        ellipsoids=ellipsoid[None],
    )


def numbers(folder):
    """Return the number that each file of some results tells."""
    found = dq.load_results(folder)
    return {
        float(found.poses[0, 0]),
        float(found.initial_poses[0, 0]),
        float(found.timestamps[0]),
        float(found.camera.fx - 500.0),
        float(found.objects.object_ids[0]),
        float(found.objects.centers[0, 0]),
    }


def in_child(work):
    """Run in a copy of this process; return its exit code, or minus the signal that ended it."""
    child = os.fork()
    if child == 0:
        try:
            work()
            os._exit(0)
        except dq.io.FileError:
            os._exit(3)
        finally:
            os._exit(4)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def killed_at(count):
    """Kill this process at a call of the system that opens, makes, renames or removes something."""
    left = [count]

    def hook(event, arguments):
        if event in _TOUCHES and (event != "open" or arguments[2] & _WRITES):
            left[0] -= 1
            if left[0] < 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)


_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_TOUCHES = ("open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.chmod", "ctypes.dlsym")


@pytest.fixture(autouse=True)
def no_waiting_for_the_disk(monkeypatch):
    """What a killed process has written is with the system, unlike after a loss of power."""
    monkeypatch.setattr(os, "fsync", lambda handle: None)


@pytest.fixture
def two_renames(monkeypatch):
    def refuse(new, old):
        raise NotImplementedError

    monkeypatch.setattr(_exchange, "_exchange_at_once", refuse)


@pytest.fixture
def in_place(monkeypatch):
    monkeypatch.setattr(_outputs, "cannot_be_renamed", lambda folder: True)


def kill_everywhere(tmp_path, look):
    """Kill the process that writes over results at each call; return what was found, in order."""
    found = []
    for count in range(1000):
        out = tmp_path / str(count) / "out"
        dq.save_estimate(estimate(OLD), out)

        def work(out=out, count=count):
            killed_at(count)
            dq.save_estimate(estimate(NEW), out)

        code = in_child(work)
        found.append(look(out))
        # Whatever was left behind does not matter to the next one.
        dq.save_estimate(estimate(NEW), out)
        assert numbers(out) == {NEW}
        assert os.listdir(out.parent) == ["out"]
        if code == 0:
            break
        assert code == -signal.SIGKILL
    assert len(found) > 30
    return found


@pytest.mark.parametrize("way", ["exchange", "two_renames"])
def test_killed_at_every_call_the_old_or_the_new_results_load(tmp_path, way, request):
    if way == "two_renames":
        request.getfixturevalue(way)
    found = kill_everywhere(tmp_path, numbers)
    assert all(one in ({OLD}, {NEW}) for one in found)
    assert found[0] == {OLD} and found[-1] == {NEW}
    assert found == sorted(found, key=max)  # once new, always new


@pytest.mark.usefixtures("in_place")
def test_where_folders_cannot_be_renamed_a_killed_process_is_told(tmp_path):
    def look(out):
        try:
            return numbers(out)
        except dq.io.FileError as error:
            assert "was interrupted" in str(error)
            return {"interrupted"}

    found = kill_everywhere(tmp_path, look)
    assert all(one in ({OLD}, {NEW}, {"interrupted"}) for one in found)
    assert {"interrupted"} in found
    assert found[0] == {OLD} and found[-1] == {NEW}


def test_first_results_are_there_or_not(tmp_path):
    for count in range(0, 500, 3):
        out = tmp_path / str(count)

        def work(out=out, count=count):
            killed_at(count)
            dq.save_estimate(estimate(NEW), out)

        code = in_child(work)
        assert not out.exists() or not os.listdir(out) or numbers(out) == {NEW}
        if code == 0:
            break
    assert numbers(out) == {NEW}


def test_a_full_disk_leaves_the_old_results(tmp_path):
    out = tmp_path / "out"
    dq.save_estimate(estimate(OLD), out)
    sizes = sorted(path.stat().st_size for path in out.iterdir())
    codes = []
    for size in range(0, sizes[-1] + 50, 25):

        def work(size=size):
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
            dq.save_estimate(estimate(NEW), out)

        codes.append(in_child(work))
        assert numbers(out) == ({NEW} if codes[-1] == 0 else {OLD})
        assert os.listdir(tmp_path) == ["out"]
    assert codes[0] == 3 and codes[-1] == 0
    assert set(codes) == {0, 3}


@pytest.mark.parametrize("way", ["exchange", "two_renames"])
def test_a_rename_that_fails_leaves_the_old_results(tmp_path, monkeypatch, way, request):
    if way == "two_renames":
        request.getfixturevalue(way)
    rename, replace = os.rename, os.replace
    for failing in range(100):
        out = tmp_path / str(failing) / "out"
        dq.save_estimate(estimate(OLD), out)
        left = [failing]

        def fails(call, left=left):
            def counted(*arguments, **options):
                left[0] -= 1
                if left[0] == -1:
                    raise OSError(5, "Input/output error")
                return call(*arguments, **options)

            return counted

        monkeypatch.setattr(os, "rename", fails(rename))
        monkeypatch.setattr(os, "replace", fails(replace))
        try:
            dq.save_estimate(estimate(NEW), out)
        except dq.io.FileError as error:
            assert "Input/output error" in str(error)
            assert ".dqslam-tmp" not in str(error)
        monkeypatch.setattr(os, "rename", rename)
        monkeypatch.setattr(os, "replace", replace)
        assert numbers(out) in ({OLD}, {NEW})
        if left[0] >= 0:
            break
    assert failing > 3
    assert numbers(out) == {NEW}
