"""What has changed between two maps: what moved, what is gone, and what nobody can tell."""

import json
from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam.places.changes.files import distance_and_sigma, read_alignment, write_changes
from dqslam.places.changes.seen_map import SeenMap, missed
from dqslam.places.visibility import view_objects
from small_place import CENTERS, NAMES, pose_at, write_map, write_turned

IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def status_of(found):
    """Return the status of each object by its row in CENTERS, ids are 10 + row."""
    return {(one.first_id, one.second_id): one.status for one in found.objects}


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    return write_map(tmp_path_factory.mktemp("before") / "a")


def test_nothing_changed(before):
    found = dq.changes(before, before)
    assert [one.status for one in found.objects] == ["stayed"] * len(NAMES)
    assert all(one.probability > 0.9 for one in found.objects)
    np.testing.assert_allclose(found.second_from_first, np.eye(4), atol=1e-6)


def test_a_cup_moves_a_book_goes_and_a_lamp_comes(before, tmp_path):
    """The second map numbers its objects anew, so that ids say nothing."""
    centers, names = CENTERS.copy(), list(NAMES)
    centers[3] += [0.4, -0.3, 0.0]
    kept = [0, 2, 3, 4, 5, 6, 7]
    centers = np.vstack([centers[kept], [[-0.2, 0.9, 0.3]]])
    names = [*(names[row] for row in kept), "lamp"]
    after = write_map(tmp_path / "b", centers, tuple(names))
    found = dq.changes(before, after)
    assert status_of(found) == {
        (10, 10): "stayed",
        (11, None): "vanished",
        (12, 11): "stayed",
        (13, 12): "moved",
        (14, 13): "stayed",
        (15, 14): "stayed",
        (16, 15): "stayed",
        (17, 16): "stayed",
        (None, 17): "appeared",
    }
    moved = found.of("moved")[0]
    distance, sigma = distance_and_sigma(moved)
    assert distance == pytest.approx(0.5, abs=0.02)
    assert 0.01 < sigma < 0.06
    assert moved.significance < 1e-9
    assert min(one.probability for one in found.objects) > 0.7


def test_nothing_changed_where_nobody_looked(before, tmp_path):
    """The second drive sees one side of the table only: its map lacks what was behind it."""
    poses = np.array([pose_at(2.5, y, 1.2) for y in np.linspace(-0.3, 0.3, 12)])
    # Cameras that look away: the same places, turned to the other side.
    away = poses.copy()
    away[:, 3:] = [pose_at(-p[0], -p[1], p[2])[3:] for p in poses]
    after = write_map(tmp_path / "b", CENTERS[:3], NAMES[:3], poses=poses)
    turned = [f"{i} " + " ".join(f"{x:.9f}" for x in pose) for i, pose in enumerate(away)]
    for name in ("trajectory.txt", "odometry.txt"):
        (after / name).write_text("\n".join(turned) + "\n")
    found = dq.changes(before, after)
    assert not found.of("vanished")
    assert not found.of("moved")
    assert len(found.of("unknown")) == 5
    assert all(one.looks < 0.5 for one in found.of("unknown"))


def test_maps_in_two_frames_need_their_motion(before, tmp_path):
    """A map that is turned by 40 degrees and shifted has nothing in common without it."""
    after, matrix = write_turned(before, tmp_path / "b")
    found = dq.changes(before, after, second_from_first=matrix)
    assert [one.status for one in found.objects] == ["stayed"] * len(NAMES)
    # A motion that is 4 cm wrong is corrected by the objects.
    wrong = matrix.copy()
    wrong[:3, 3] += [0.03, -0.02, 0.02]
    found = dq.changes(before, after, second_from_first=wrong)
    assert len(found.of("stayed")) == len(NAMES)
    np.testing.assert_allclose(found.second_from_first[:3, 3], matrix[:3, 3], atol=0.01)


def test_a_motion_that_is_none_is_refused(before):
    with pytest.raises(ValueError, match="second_from_first: not a rotation"):
        dq.changes(before, before, second_from_first=2.0 * np.eye(4))
    with pytest.raises(ValueError, match=r"second_from_first: expected shape \(4, 4\)"):
        dq.changes(before, before, second_from_first=np.eye(3))
    with pytest.raises(ValueError, match="covariance row 0: covariance is not positive definite"):
        dq.changes(before, before, covariance=np.zeros((6, 6)))


def test_an_object_that_needs_three_boxes_is_missed_as_poisson_says():
    """P(0, 1 or 2 of mean 2) = 5 e^-2, and 2 % are lost for other reasons."""
    expected = 0.02 + 0.98 * 5.0 * np.exp(-2.0)
    np.testing.assert_allclose(missed(np.array([0.0, 2.0])), [1.0, expected], rtol=1e-12)


def test_a_nearer_object_hides_and_touching_ones_do_not():
    """A large sphere 1 m before a small one covers its box; one at the same place does not."""
    camera = dq.Camera(500.0, 500.0, 320.0, 240.0, 640, 480)
    axes = [(0.1, [0, 0, 3.0]), (0.3, [0, 0, 2.0]), (0.12, [0.02, 0, 3.05])]
    spheres = [dq._core.ellipsoid_from_axes(c, [r] * 3, [0, 0, 0, 1]) for r, c in axes]
    pose = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    views = view_objects(camera, pose, np.array(spheres))
    np.testing.assert_allclose(views.covered[0], [1.0, 0.0, 1.0])
    views = view_objects(camera, pose, np.array(spheres)[[0, 2]])
    np.testing.assert_allclose(views.covered[0], [0.0, 0.0])
    # The outline of a sphere on the axis has the radius f r / sqrt(d^2 - r^2).
    side = 2 * 500.0 * 0.1 / np.sqrt(9.0 - 0.01)
    assert views.size[0, 0] == pytest.approx(side, rel=1e-9)
    hides = np.array([True, False, True])
    views = view_objects(camera, pose, np.array(spheres), hides)
    np.testing.assert_allclose(views.covered[0], [0.0, 0.0, 0.0])


def test_files(before, tmp_path):
    found = dq.changes(before, before)
    write_changes(tmp_path, found)
    lines = (tmp_path / "changes.csv").read_text().splitlines()
    assert lines[0].startswith("status,probability,first_id,second_id,class_name,x1,y1,z1")
    assert len(lines) == 1 + len(NAMES)
    content = json.loads((tmp_path / "changes.json").read_text())
    assert content["objects"][2]["first_center"] == pytest.approx(CENTERS[2].tolist())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not JSON"),
        ("{}", "has no b_from_a"),
        ('{"b_from_a": [[1, 0], [0, 1]]}', r"b_from_a: expected shape \(4, 4\)"),
    ],
)
def test_bad_alignments_are_refused(tmp_path, text, message):
    path = tmp_path / "alignment.json"
    path.write_text(text)
    with pytest.raises(dq.io.FileError, match=message):
        read_alignment(path)


def test_an_alignment_is_read(tmp_path):
    path = tmp_path / "alignment.json"
    path.write_text(json.dumps({"b_from_a": np.eye(4).tolist(), "covariance": np.eye(6).tolist()}))
    pose, covariance = read_alignment(path)
    np.testing.assert_array_equal(pose, np.eye(4))
    np.testing.assert_array_equal(covariance, np.eye(6))


@pytest.mark.parametrize(("distance", "status"), [(0.05, "unknown"), (0.13, "appeared")])
def test_a_thing_within_another_of_its_class_may_be_mapped_twice(tmp_path, distance, status):
    """Cups of 10 to 12 cm do not stand 5 cm from each other; 13 cm are enough."""
    before = write_map(tmp_path / "a")
    beside = CENTERS[0] + [distance, 0.0, 0.0]
    after = write_map(tmp_path / "b", np.vstack([CENTERS, [beside]]), (*NAMES, "cup"))
    there = status_of(dq.changes(before, after))
    assert there[None, 18] == status
    back = status_of(dq.changes(after, before))
    assert back[18, None] == {"unknown": "unknown", "appeared": "vanished"}[status]


def test_objects_within_each_other_reach_past_their_middle(tmp_path):
    """Spheres of radius 0.1: nearer than 0.75 * 0.2 m, and of one class."""
    centers = np.array([[0.0, 0.0, 0.0], [0.149, 0.0, 0.0], [0.0, 0.151, 0.0], [0.0, 0.0, 0.05]])
    names = ("cup", "cup", "cup", "bowl")
    seen = SeenMap.of(dq.load_results(write_map(tmp_path / "a", centers, names)), IDENTITY)
    spheres = [dq._core.ellipsoid_from_axes(c, [0.1] * 3, [0.0, 0.0, 0.0, 1.0]) for c in centers]
    found = replace(seen, centers=centers, ellipsoids=np.array(spheres)).within_each_other()
    assert np.argwhere(found).tolist() == [[0, 1], [1, 0]]
