"""A session as MCAP while it runs, read back by another library."""

import contextlib
import json
import socket
import struct
from types import SimpleNamespace

import numpy as np
import pytest

import dqslam as dq
from dqslam.cli import main
from dqslam.io import load_results
from dqslam.view import record_session, serve_session
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


def test_each_step_goes_over_a_websocket_while_the_session_runs():
    """Another program gets the pose of a step before the next step is taken."""
    client = pytest.importorskip("websockets.sync.client", reason="websockets comes with viser")
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=0)
    slam, steps = dq.OnlineSlam(recording.camera), list(dq.steps_of(recording))
    with (
        serve_session("a drive", "127.0.0.1", 0) as (address, show),
        client.connect(address, subprotocols=["foxglove.sdk.v1"]) as connection,
    ):
        ids = {}
        while "/pose" not in ids:
            message = connection.recv(timeout=30)
            if isinstance(message, str) and json.loads(message)["op"] == "advertise":
                ids |= {one["topic"]: one["id"] for one in json.loads(message)["channels"]}
        wanted = {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": ids["/pose"]}]}
        connection.send(json.dumps(wanted))
        for step in steps[:20]:
            slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
            received = None
            while received is None:  # until the server has taken the subscription
                show(slam, step)
                with contextlib.suppress(TimeoutError):
                    while not isinstance(received := connection.recv(timeout=1), bytes):
                        received = None
            # A message: 1, the subscription, the time in ns, and the pose as protobuf.
            kind, subscription, at = struct.unpack_from("<BIQ", received)
            assert (kind, subscription, at) == (1, 7, round(1e9 * step.timestamp))
            assert struct.pack("<d", slam.pose[0]) in received or slam.pose[0] == 0.0


def test_a_port_that_is_taken_is_an_error():
    with (
        serve_session("first", "127.0.0.1", 0) as (address, _),
        pytest.raises(ValueError, match="cannot be served"),
        serve_session("second", "127.0.0.1", int(address.rsplit(":", 1)[1])),
    ):
        pass


def test_the_command_shows_a_session_in_the_time_of_the_recording(
    files, tmp_path, free_port, monkeypatch
):
    """24 images, 0.1 s apart, by a clock that goes on only while the command waits."""
    clock = [50.0]

    def wait(seconds):
        clock[0] += seconds

    monkeypatch.setattr(
        "dqslam.view.session.time", SimpleNamespace(monotonic=lambda: clock[0], sleep=wait)
    )
    assert main(command(files, tmp_path, "--foxglove", "--port", str(free_port))) == 0
    assert clock[0] == pytest.approx(50.0 + 2.3, abs=1e-6)


def test_the_websocket_is_for_sessions(files, tmp_path, capsys):
    words = [one for one in command(files, tmp_path, "--foxglove") if one != "--online"]
    assert main(words) == 2
    assert "--foxglove: needs --online" in capsys.readouterr().err


@pytest.fixture
def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]
