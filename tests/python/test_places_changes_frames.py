"""How the frames of two maps that are compared lie to each other, if nobody says so."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam.cli import main
from dqslam.places.changes.files import read_alignment
from dqslam.places.changes.frames import covariance_in_b, one_frame_evidence
from dqslam.places.changes.seen_map import SeenMap
from small_place import CENTERS, NAMES, write_map, write_turned

HERE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    return write_map(tmp_path_factory.mktemp("before") / "a")


def test_maps_of_one_frame_are_left_in_it(before, tmp_path):
    centers = CENTERS.copy()
    centers[3] += [0.4, -0.3, 0.0]
    found = dq.changes(before, write_map(tmp_path / "b", centers), second_from_first="find")
    assert found.frame == "one frame: 7 objects are at one place in both maps"
    assert [one.status for one in found.objects].count("moved") == 1
    np.testing.assert_allclose(found.second_from_first, np.eye(4), atol=1e-3)


def test_a_turned_map_is_aligned(before, tmp_path):
    after, matrix = write_turned(before, tmp_path / "b")
    found = dq.changes(before, after, second_from_first="find")
    assert found.frame.startswith("aligned by 8 objects: in one frame, ")
    assert [one.status for one in found.objects] == ["stayed"] * len(NAMES)
    np.testing.assert_allclose(found.second_from_first, matrix, atol=1e-2)


def test_the_evidence_is_chernoffs_bound(before):
    """Eight objects of five classes, each alone in its gate, in a rectangle that numpy measures."""
    results = dq.load_results(before)
    one = SeenMap.of(results, HERE)
    one = replace(one, center_covariances=np.tile(1e-4 * np.eye(3), (8, 1, 1)))
    hits, evidence = one_frame_evidence(one, one)
    middle = CENTERS - CENTERS.mean(axis=0)
    along = middle @ np.linalg.eigh(middle.T @ middle)[1][:, 1:]
    area = np.prod(along.max(axis=0) - along.min(axis=0))
    pairs = sum(NAMES.count(name) ** 2 for name in set(NAMES))
    expected = pairs * np.pi * 9.0 * 2e-4 / area
    assert hits == 8
    assert evidence == pytest.approx(8 * np.log(8 / expected) - 8 + expected, rel=1e-9)


def test_strewn_objects_are_no_evidence_of_one_frame(before):
    """Chernoff's bound holds: evidence above ln 20 in less than one of 20 unrelated maps."""
    one = SeenMap.of(dq.load_results(before), HERE)
    one = replace(one, center_covariances=np.tile(0.01 * np.eye(3), (8, 1, 1)))
    random = np.random.default_rng(0)
    low, high = CENTERS.min(axis=0), CENTERS.max(axis=0)
    sure = 0
    for _ in range(400):
        other = replace(one, centers=random.uniform(low, high, (8, 3)))
        sure += one_frame_evidence(other, one)[1] > np.log(20.0)
    assert sure < 20


def test_the_covariance_moves_with_the_frame():
    """Compared with small motions in the frame of A, carried to B by matrices."""
    b_from_a = np.eye(4)
    b_from_a[:3, :3] = Rotation.from_rotvec([0.3, -0.2, 1.1]).as_matrix()
    b_from_a[:3, 3] = [4.0, -3.0, 0.5]
    for axis in range(6):
        xi = 1e-6 * np.eye(6)[axis]
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = Rotation.from_rotvec(xi[3:]).as_matrix(), xi[:3]
        moved = b_from_a @ step @ np.linalg.inv(b_from_a)
        seen = np.concatenate([moved[:3, 3], Rotation.from_matrix(moved[:3, :3]).as_rotvec()])
        # The others vary so little that this axis is left; none is 0, which would be filled.
        covariance = 1e-12 * np.eye(6)
        covariance[axis, axis] = 1.0
        expected = np.outer(seen, seen) / 1e-12
        np.testing.assert_allclose(covariance_in_b(b_from_a, covariance), expected, atol=1e-4)


def test_an_alignment_of_upright_maps_is_read(tmp_path):
    """Its roll and pitch are exact; two maps are not that upright."""
    b_from_a = np.eye(4)
    b_from_a[:3, 3] = [0.0, 2.0, 0.0]
    path = tmp_path / "alignment.json"
    content = {"b_from_a": b_from_a.tolist(), "covariance": np.diag([1, 1, 1, 0, 0, 1.0]).tolist()}
    path.write_text(json.dumps(content))
    _, covariance = read_alignment(path)
    # A turn about z of the frame of A moves the origin of B by 2 m along x.
    assert covariance[0, 0] == pytest.approx(1.0 + 4.0)
    assert covariance[0, 5] == pytest.approx(2.0)
    assert covariance[3, 3] == covariance[4, 4] == pytest.approx(0.02**2)


@pytest.mark.parametrize(
    ("given", "message"),
    [({"second_from_first": "ask"}, "a matrix, None"), ({"covariance": np.eye(6)}, "without")],
)
def test_what_is_neither_a_motion_nor_a_wish_is_refused(before, given, message):
    with pytest.raises(ValueError, match=message):
        dq.changes(before, before, **({"second_from_first": "find"} | given))


def test_the_command_exits_with_3_where_it_cannot_tell(before, tmp_path, capsys):
    random = np.random.default_rng(3)
    other = write_map(tmp_path / "b", random.uniform(-1.0, 1.0, (8, 3)) + [0.0, 0.0, 1.0])
    given = ["changes", str(before), str(other), "--out", str(tmp_path / "out")]
    assert main(given) == 3
    told = " ".join(capsys.readouterr().err.split())
    assert "cannot tell how" in told
    assert "--one-frame or --b-from-a says it" in told
    assert not (tmp_path / "out").exists()
    assert main([*given, "--one-frame", "--quiet"]) == 0
    assert json.loads((tmp_path / "out" / "changes.json").read_text())["frame"] == ""


def test_two_answers_to_one_question_are_refused(before, tmp_path, capsys):
    folder = str(before)
    assert main(["changes", folder, folder, "--one-frame", "--b-from-a", "x.json"]) == 2
    assert "contradict each other" in capsys.readouterr().err
