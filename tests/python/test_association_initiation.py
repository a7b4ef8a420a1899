import numpy as np
import pytest

from dqslam.association import cameras_by_odometry, cast_rays
from dqslam.association.initiation import MIN_PARALLAX, MIN_VIEWS, parallax, propose_groups
from scenes import Thing, film, orbit_poses, street_poses, table_things

# --- rays


def test_a_ray_by_hand():
    """A ball of 0.3 m, 10 m ahead, 4 m to the right: its middle and its width."""
    pose = np.array([[1.0, 2.0, 3.0, 0, 0, 0, 1.0]])
    made = film(
        np.repeat(pose, 2, axis=0),
        [Thing(np.array([5.0, 2.0, 13.0]), np.full(3, 0.3))],
        noise_px=0.0,
    )
    rays = cast_rays(made.recording, cameras_by_odometry(made.recording))
    np.testing.assert_allclose(rays.origin[0], [1.0, 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(rays.direction[0], np.array([4, 0, 10]) / 116**0.5, atol=1e-3)
    assert np.linalg.norm(rays.direction[0]) == pytest.approx(1.0)
    assert rays.half_width[0] * 116**0.5 == pytest.approx(0.3, rel=0.05)


def test_half_widths_do_not_depend_on_where_in_the_image():
    places = [np.array([6 * np.sin(a), 0.0, 6 * np.cos(a)]) for a in (0.0, 0.3, 0.5)]
    made = film(
        street_poses(2, step=1e-9), [Thing(p, np.full(3, 0.1)) for p in places], noise_px=0.0
    )
    rays = cast_rays(made.recording, cameras_by_odometry(made.recording))
    np.testing.assert_allclose(rays.half_width, 0.1 / 6, rtol=0.1)


def test_parallax_is_the_largest_angle_between_two_rays():
    poses = street_poses(4, step=0.0)
    poses[:, 0] = [0.0, 1.0, -1.0, 0.5]
    made = film(poses, [Thing(np.array([0.0, 0.0, 10.0]), np.full(3, 0.3))], noise_px=0.0)
    rays = cast_rays(made.recording, cameras_by_odometry(made.recording))
    assert parallax(rays, np.arange(4)) == pytest.approx(2 * np.arctan(0.1), rel=2e-3)
    assert parallax(rays, np.array([0, 1])) == pytest.approx(np.arctan(0.1), rel=2e-3)
    assert parallax(rays, np.array([2])) == pytest.approx(0.0, abs=1e-7)


# --- groups


def groups_of(made, tracklet=None, **options):
    count = len(made.recording.detections)
    rows = np.arange(count)
    tracklet = rows if tracklet is None else tracklet
    cameras = cameras_by_odometry(made.recording)
    return propose_groups(made.recording, cameras, rows, tracklet, **options)


def shown(made, group):
    """Return which things the boxes of a group show."""
    return set(made.thing[group].tolist())


@pytest.mark.parametrize("seed", range(5))
def test_boxes_of_objects_are_found_among_clutter(seed):
    """No tracklets at all; four of a class, eight images, a box of nothing in every one."""
    things = [Thing(one.center, np.full(3, 0.05)) for one in table_things(8)[::2]]
    made = film(orbit_poses(8), things, missed=0.1, false_positives=1.0, seed=seed)
    groups = groups_of(made)
    assert len(groups) >= 4
    for number in range(4):
        most = max(groups, key=lambda group: np.sum(made.thing[group] == number))
        right = np.sum(made.thing[most] == number)
        assert right >= 0.8 * np.sum(made.thing == number)
        assert right >= len(most) - 1  # a box of nothing may agree
    for group in groups:
        poses = made.recording.detections.pose[group]
        assert len(np.unique(poses)) == len(poses) >= MIN_VIEWS


def test_classes_are_not_mixed():
    place = np.array([0.1, 0.0, 0.0])
    things = [
        Thing(place, np.full(3, 0.05), class_id=1),
        Thing(place, np.full(3, 0.05), class_id=3),
    ]
    made = film(orbit_poses(8), things)
    assert sorted(sorted(shown(made, group)) for group in groups_of(made)) == [[0], [1]]


def test_tracklets_that_are_long_enough_are_groups_by_themselves():
    made = film(orbit_poses(8), [Thing(np.zeros(3), np.full(3, 0.05)) for _ in range(2)])
    tracklet = made.thing.copy()
    groups = groups_of(made, tracklet)
    assert [shown(made, group) for group in groups] == [{0}, {1}]
    # Of too few boxes, they meet others in space, unless ids are final.
    tracklet = 2 * (made.recording.detections.pose // 3) + made.thing
    assert np.bincount(tracklet).max() < MIN_VIEWS
    assert sum(len(group) for group in groups_of(made, tracklet)) == len(made.thing)
    assert groups_of(made, tracklet, tracklets_only=True) == []


def test_without_parallax_nothing_starts():
    """Boxes that grow on the way there do not tell the distance well enough."""
    poses = street_poses(6, step=0.1)
    thing = Thing(np.array([0.0, 0.0, 10.0]), np.full(3, 0.3))
    made = film(poses, [thing])
    assert groups_of(made, made.thing) == []
    assert groups_of(made) == []
    poses[:, 0] = np.linspace(0.0, 10.0 * 1.2 * MIN_PARALLAX, 6)
    assert len(groups_of(film(poses, [thing]), made.thing)) == 1


def test_rays_that_meet_behind_the_cameras_are_no_object():
    """Boxes that drift apart faster than any place ahead allows."""
    poses = street_poses(6, step=0.0)
    poses[:, 0] = 0.5 * np.arange(6)
    path = np.array([[1.0 * i, 0.0, 5.0] for i in range(6)])
    made = film(poses, [Thing(path[0], np.full(3, 0.3), path=path)])
    rays = cast_rays(made.recording, cameras_by_odometry(made.recording))
    assert parallax(rays, np.arange(6)) > 2 * MIN_PARALLAX
    assert groups_of(made) == []


def test_nothing_waits():
    made = film(orbit_poses(4), [Thing(np.zeros(3), np.full(3, 0.05))])
    none = np.zeros(0, dtype=np.int64)
    cameras = cameras_by_odometry(made.recording)
    assert propose_groups(made.recording, cameras, none, made.thing) == []
