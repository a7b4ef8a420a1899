"""MCAP files, read back by another library: objects in are primitives out."""

import numpy as np
import pytest

import planted
from dqslam.cli import main
from dqslam.io import load_results
from dqslam.view import build_scene, write_mcap

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed: the extra mcap")


@pytest.fixture
def files(tmp_path):
    return planted.write_planted(tmp_path)


def read(path):
    """Return the messages of each topic with their times [ns], and the schemas."""
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_protobuf.decoder")
    messages, schemas = {}, {}
    with path.open("rb") as file:
        opened = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        for schema, channel, message, decoded in opened.iter_decoded_messages():
            messages.setdefault(channel.topic, []).append((message.log_time, decoded))
            schemas[channel.topic] = schema.name
    return messages, schemas


def vector(one):
    return [one.x, one.y, one.z]


def quaternion(one):
    return [one.x, one.y, one.z, one.w]


def test_objects_in_are_primitives_out(files, tmp_path):
    path = tmp_path / "map.mcap"
    truth = ["--groundtruth", str(files.groundtruth), "--objects", str(files.objects)]
    assert main(["view", str(files.results), *truth, "--mcap", str(path), "-q"]) == 0
    messages, schemas = read(path)
    assert schemas == {
        "/map": "foxglove.SceneUpdate",
        "/truth": "foxglove.SceneUpdate",
        "/paths": "foxglove.SceneUpdate",
        "/tf": "foxglove.FrameTransforms",
        "/pose": "foxglove.PoseInFrame",
        "/boxes": "foxglove.ImageAnnotations",
        "/outlines": "foxglove.ImageAnnotations",
        "/calibration": "foxglove.CameraCalibration",
    }
    objects = load_results(files.results).objects
    ((_, update),) = messages["/map"]
    assert [one.texts[0].text for one in update.entities] == [
        f"{name} {number}"
        for name, number in zip(objects.class_names, objects.object_ids, strict=True)
    ]
    for row, entity in enumerate(update.entities):
        (sphere,) = entity.spheres
        np.testing.assert_allclose(vector(sphere.size), 2 * objects.semi_axes[row], rtol=1e-6)
        np.testing.assert_allclose(
            vector(sphere.pose.position), objects.centers[row], rtol=1e-6, atol=1e-9
        )
        turn = quaternion(sphere.pose.orientation)
        np.testing.assert_allclose(turn, objects.orientations[row], atol=1e-6)
        found = {pair.key: pair.value for pair in entity.metadata}
        assert (found["class"], found["id"]) == (
            objects.class_names[row],
            str(objects.object_ids[row]),
        )
    ((_, true),) = messages["/truth"]
    assert len(true.entities) == 6
    scene = build_scene(load_results(files.results))
    assert len(scene.objects) == 5


def test_frames_boxes_and_outlines_are_at_their_times(files, tmp_path):
    path = tmp_path / "map.mcap"
    results = load_results(files.results)
    scene = build_scene(results)
    write_mcap(scene, path)
    messages, _ = read(path)
    times = [round(moment * 1e9) for moment in results.timestamps]
    for topic in ("/tf", "/pose", "/boxes", "/outlines"):
        assert [at for at, _ in messages[topic]] == times
    for pose, ((_, moved), (_, here)) in enumerate(
        zip(messages["/tf"], messages["/pose"], strict=True)
    ):
        (transform,) = moved.transforms
        assert (transform.parent_frame_id, transform.child_frame_id) == ("world", "camera")
        expected = results.poses[pose]
        np.testing.assert_allclose(vector(transform.translation), expected[:3], atol=1e-9)
        np.testing.assert_allclose(quaternion(transform.rotation), expected[3:], atol=1e-9)
        np.testing.assert_allclose(vector(here.pose.position), expected[:3], atol=1e-9)
        assert transform.timestamp.seconds * 10**9 + transform.timestamp.nanos == times[pose]
    _, drawn = messages["/boxes"][4]
    rows = np.flatnonzero(scene.boxes.pose == 4)
    corners = [[[p.x, p.y] for p in one.points] for one in drawn.points]
    found = np.array([[*np.min(one, axis=0), *np.max(one, axis=0)] for one in corners])
    # Foxglove counts from the corner of the first pixel.
    np.testing.assert_allclose(found, scene.boxes.box[rows] + 0.5, atol=1e-9)
    _, outlines = messages["/outlines"][4]
    assert len(outlines.points) >= 3
    ((_, paths),) = messages["/paths"]
    assert [one.id for one in paths.entities] == ["estimate", "odometry"]
    estimate = np.array([vector(point) for point in paths.entities[0].lines[0].points])
    np.testing.assert_allclose(estimate, results.poses[:, :3], atol=1e-9)
    ((_, calibration),) = messages["/calibration"]
    camera = results.camera
    assert list(calibration.K) == [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1]


def test_run_writes_it_too(tmp_path):
    recording, path = tmp_path / "rec", tmp_path / "map.mcap"
    assert main(["simulate", "orbit", "--seed", "1", "--out", str(recording), "-q"]) == 0
    config = ["--config", str(recording / "run.toml"), "-o", str(tmp_path / "out")]
    assert main(["run", *config, "--mcap", str(path), "-q"]) == 0
    ((_, update),) = read(path)[0]["/map"]
    objects = load_results(tmp_path / "out").objects
    sizes = [vector(one.spheres[0].size) for one in update.entities]
    np.testing.assert_allclose(sizes, 2 * objects.semi_axes, rtol=1e-6)


def test_what_is_no_ellipsoid_has_a_name_only(files, tmp_path):
    from dataclasses import replace

    scene = build_scene(load_results(files.results))
    flat = replace(scene.objects[0], semi_axes=None, orientation_xyzw=None)
    write_mcap(replace(scene, objects=(flat, *scene.objects[1:])), tmp_path / "map.mcap")
    ((_, update),) = read(tmp_path / "map.mcap")[0]["/map"]
    assert [len(one.spheres) for one in update.entities] == [0, 1, 1, 1, 1]


def test_times_that_have_no_place(files, tmp_path):
    from dataclasses import replace

    scene = build_scene(load_results(files.results))
    early = replace(scene, timestamps=scene.timestamps - 101.0)
    with pytest.raises(ValueError, match=r"pose 0 is at -1 s: MCAP has times from 0 to 4294967295"):
        write_mcap(early, tmp_path / "map.mcap")
    assert not (tmp_path / "map.mcap").exists()


def test_live_over_a_websocket(files):
    """A client that speaks Foxglove's protocol is told of the topics."""
    client = pytest.importorskip("websockets.sync.client", reason="websockets comes with viser")
    import json

    from dqslam.view import serve_foxglove

    scene = build_scene(load_results(files.results))
    with (
        serve_foxglove(scene, "127.0.0.1", 0) as (address, play),
        client.connect(address, subprotocols=["foxglove.sdk.v1"]) as connection,
    ):
        topics = {}
        play()
        while len(topics) < 7:
            message = connection.recv(timeout=30)
            if isinstance(message, str) and json.loads(message)["op"] == "advertise":
                for channel in json.loads(message)["channels"]:
                    topics[channel["topic"]] = channel["schemaName"]
        assert topics["/map"] == "foxglove.SceneUpdate"
        assert topics["/boxes"] == "foxglove.ImageAnnotations"
