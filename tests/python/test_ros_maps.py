"""Saved maps, lost odometry and lost cameras in the logic of the ROS node."""

import numpy as np
import pytest

import dqslam as dq
from orbit import make_orbit
from ros_messages import detections, odometry, ready, robot_path

from dqslam_ros.poses import matrix_of, pose_of  # isort: skip


@pytest.fixture(scope="module")
def orbit():
    return make_orbit(count=80, noise_px=0.5)


def play(session, orbit, poses, path):
    """Feed images and odometry, and return how many were steps."""
    steps = 0
    for pose in poses:
        session.take_odometry(odometry(orbit.times[pose], path[pose]))
        session.take_detections(detections(orbit, pose))
        steps += session.step()
    return steps


@pytest.fixture(scope="module")
def saved(orbit, tmp_path_factory):
    folder = tmp_path_factory.mktemp("saved") / "map"
    session = ready()
    assert play(session, orbit, range(60), robot_path(orbit)) == 60
    session.slam.polish()
    session.save(folder)
    return folder


def test_a_saved_map_is_continued_where_the_camera_is_found_in_it(orbit, saved):
    """Odometry begins anew elsewhere; the correction leads it to the frame of the saved map."""
    true = robot_path(orbit)
    elsewhere = matrix_of([5.0, -3.0, 0.0, 0.0, 0.0, np.sin(0.5), np.cos(0.5)])
    moved = [pose_of(elsewhere @ matrix_of(pose)) for pose in true]
    session = ready()
    session.load(saved)
    assert session.map_from_odom() is None
    assert play(session, orbit, range(60, 80), moved) == 20
    expected = np.linalg.inv(elsewhere)
    found = matrix_of(session.map_from_odom())
    np.testing.assert_allclose(found, expected, atol=0.03)
    names = sorted(dq.load_results(saved).objects.class_names)
    assert sorted(one.class_name for one in session.objects()) == names


def test_an_image_that_does_not_tell_where_it_is_is_counted_and_the_next_one_is_tried(orbit, saved):
    session, true = ready(), robot_path(orbit)
    session.load(saved)
    few = detections(orbit, 60)
    few.detections = few.detections[:2]
    session.take_odometry(odometry(orbit.times[60], true[60]))
    session.take_detections(few)
    assert session.step() == 0
    (reason,) = session.counts.not_located
    assert reason.startswith("image at 106.000000 s: ")
    assert session.counts.refused == []
    assert play(session, orbit, [61], true) == 1
    assert session.is_located


def test_a_map_that_is_not_there_changes_nothing(orbit, tmp_path):
    session, true = ready(), robot_path(orbit)
    play(session, orbit, range(3), true)
    with pytest.raises(ValueError, match="nowhere"):
        session.load(tmp_path / "nowhere")
    assert play(session, orbit, [3], true) == 1


def test_a_map_of_another_camera_is_refused(orbit, saved):
    session, true = ready(), robot_path(orbit)
    object.__setattr__(session._camera, "wide", dq.Camera(400, 400, 319.5, 239.5, 640, 480))
    session.load(saved)
    assert play(session, orbit, [60], true) == 0
    assert "was made with another camera" in session.counts.refused[0]


def test_odometry_that_jumps_is_taken_up_by_relocalizing(orbit):
    """The odometry begins anew after 60 images; the map and the path stay where they are."""
    true = robot_path(orbit)
    jump = matrix_of([0.0, 4.0, 0.0, 0.0, 0.0, np.sin(1.0), np.cos(1.0)])
    session = ready()
    play(session, orbit, range(60), true)
    before = {one.id: one.pose[:3] for one in session.objects()}
    session.relocalize()
    assert session.map_from_odom() is None and session.map_from_base() is None
    path = {pose: pose_of(jump @ matrix_of(true[pose])) for pose in range(60, 80)}
    assert play(session, orbit, range(60, 80), path) == 20
    _, base = session.map_from_base()
    assert np.linalg.norm(base[:3] - true[79][:3]) < 0.05
    after = {one.id: one.pose[:3] for one in session.objects()}
    for name, center in before.items():
        np.testing.assert_allclose(after[name], center, atol=0.02)


def test_a_camera_that_was_lost_goes_on_by_the_odometry(orbit):
    session, true = ready(silence_s=1.0), robot_path(orbit)
    assert session.silence(50.0) is None  # nothing has ever come
    play(session, orbit, range(30), true)
    assert session.silence(orbit.times[29] + 0.9) is None
    for pose in range(30, 60):
        session.take_odometry(odometry(orbit.times[pose], true[pose]))
        assert session.step() == 0
    now = orbit.times[59]
    assert session.silence(now) == "no images with boxes for 3.0 s"
    assert session.silence(now + 2.0) == "no images with boxes for 5.0 s; no odometry for 2.0 s"
    assert play(session, orbit, range(60, 80), true) == 20
    assert session.silence(orbit.times[79]) is None
    _, base = session.map_from_base()
    assert np.linalg.norm(base[:3] - true[79][:3]) < 0.05


def test_tf_may_be_asked_for_the_odometry_of_images_that_wait(orbit):
    session, true = ready(), robot_path(orbit)
    for pose in (1, 0):
        session.take_detections(detections(orbit, pose))
    assert session.waiting_times == [orbit.times[0], pytest.approx(orbit.times[1], abs=1e-9)]
    for time, pose in zip(session.waiting_times, true, strict=False):
        message = odometry(time, pose).pose.pose
        session.take_pose(time, message.position, message.orientation)
    assert session.waiting_times == []
    assert session.step() == 2


def test_objects_have_lengths_along_their_axes(orbit):
    session, true = ready(), robot_path(orbit)
    play(session, orbit, range(60), true)
    session.slam.polish()
    for one in session.objects():
        distance = {name: np.linalg.norm(one.pose[:3] - at) for name, at in orbit.centers.items()}
        nearest = min(distance, key=distance.get)
        assert distance[nearest] < 0.05
        expected = np.sort(2.0 * orbit.semi_axes[nearest])
        np.testing.assert_allclose(np.sort(one.size), expected, rtol=0.35)
        assert np.linalg.det(matrix_of(one.pose)[:3, :3]) == pytest.approx(1.0)
