"""A session as MCAP while it runs, read back by another library."""

import numpy as np
import pytest

import dqslam as dq
from dqslam.cli import main
from dqslam.io import load_results
from dqslam.view import record_session
from orbit import make_orbit, write_orbit
from test_view_foxglove import read, vector

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed: the extra mcap")


@pytest.fixture
def files(tmp_path):
    return write_orbit(tmp_path, make_orbit(24, noise_px=0.5))


def command(files, tmp_path, *more):
    options = [
        word
        for kind, path in zip(("camera", "odometry", "detections"), files, strict=True)
        for word in (f"--{kind}", str(path))
    ]
    return ["run", *options, "--online", "--out", str(tmp_path / "out"), "--quiet", *more]


def test_each_step_is_in_the_file_at_its_time(files, tmp_path):
    path = tmp_path / "live.mcap"
    assert main(command(files, tmp_path, "--mcap", str(path))) == 0
    messages, _ = read(path)
    times = [at for at, _ in messages["/pose"]]
    assert times == [round(1e9 * (100.0 + 0.1 * step)) for step in range(24)]
    assert [len(boxes.points) for _, boxes in messages["/boxes"]] == [4] * 24
    # Every second: at the first step, 1 s and 2 s later; and at the end the result.
    assert len(messages["/map"]) == 4
    results = load_results(tmp_path / "out")
    last = {one.texts[0].text: one.spheres[0] for one in messages["/map"][-1][1].entities}
    for row, name in enumerate(results.objects.class_names):
        sphere = last[f"{name} {results.objects.object_ids[row]}"]
        np.testing.assert_allclose(
            vector(sphere.pose.position), results.objects.centers[row], atol=1e-6
        )
    lengths = [len(paths.entities[0].lines[0].points) for _, paths in messages["/paths"]]
    assert lengths == [1, 11, 21, 24]


def test_the_poses_are_those_of_the_session_at_that_time(tmp_path):
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=0)
    slam, path, poses = dq.OnlineSlam(recording.camera), tmp_path / "live.mcap", []
    with record_session(path) as record:
        for step in list(dq.steps_of(recording))[:30]:
            slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
            record(slam, step)
            poses.append(slam.pose[:2])
    messages, _ = read(path)
    found = np.array([vector(one.pose.position) for _, one in messages["/pose"]])
    # The camera is in the middle of the robot of this scenario, or beside it by a constant.
    mount = np.asarray(recording.camera.robot_from_camera)[:3]
    assert np.linalg.norm(found[:, :2] - poses, axis=1) == pytest.approx(
        np.full(30, np.linalg.norm(mount[:2])), abs=1e-9
    )


def test_the_file_grows_while_the_session_runs(tmp_path):
    recording, _ = dq.simulate(dq.load_scenario("orbit"), seed=0)
    slam, path, sizes = dq.OnlineSlam(recording.camera), tmp_path / "live.mcap", []
    with record_session(path) as record:
        for step in dq.steps_of(recording):
            slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
            record(slam, step)
            sizes.append(path.stat().st_size)
    assert 0 < sizes[40] < sizes[80] < sizes[-1]


def test_a_file_in_the_folder_of_the_results_is_refused(files, tmp_path, capsys):
    inside = tmp_path / "out" / "live.mcap"
    assert main(command(files, tmp_path, "--mcap", str(inside))) == 2
    assert "cannot be in the folder of the results" in capsys.readouterr().err
    assert not inside.parent.exists()


def test_a_file_that_cannot_be_written_is_said(tmp_path):
    with pytest.raises(dq.io.FileError, match="cannot be written"), record_session(tmp_path):
        pass
