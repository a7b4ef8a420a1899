"""From an association to the solver: the graph that it gives, and where it starts."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from scenes import film, orbit_poses, table_things

NOISE = dq.OdometryNoise(0.02, 0.01)
BOXES = dq.BoxNoise(1.0, 0.02)


@pytest.fixture(scope="module")
def made():
    wrong = {"missed": 0.2, "false_positives": 0.5}
    return film(orbit_poses(40), table_things(8), noise=NOISE, seed=0, **wrong)


@pytest.fixture(scope="module")
def found(made):
    return dq.associate(made.recording, estimates_noise=False, box_noise=BOXES)


def test_associate_build_graph_solve(made, found):
    graph = found.build_graph()
    assert graph.object_ids.tolist() == list(range(8))
    np.testing.assert_array_equal(graph.timestamps, made.recording.timestamps[found.keyframes])
    for options, start in (
        (dq.SolveOptions(loss=dq.Loss.CAUCHY), None),
        (dq.SolveOptions(loss=dq.Loss.CAUCHY), found.start(graph)),
    ):
        estimate, _ = dq.solve(graph, options, start=start)
        assert made.ate(dq.association.fill_in(made.recording, found.keyframes, estimate.poses)) < (
            0.5 * made.ate(made.odometry)
        )
        for number, center in zip(estimate.object_ids, estimate.centers, strict=True):
            shown = made.thing[found.object_id == number]
            thing = np.bincount(shown[shown >= 0]).argmax()
            assert np.linalg.norm(center - made.centers[thing]) < 0.05


def test_the_boxes_of_the_graph_are_those_that_were_given_an_object(made, found):
    graph = found.build_graph()
    boxes = made.recording.detections
    in_keyframes = np.isin(boxes.pose, found.keyframes)
    shown = found.object_id[in_keyframes]
    np.testing.assert_array_equal(graph.core.boxes.box, boxes.box[in_keyframes][shown >= 0])
    np.testing.assert_array_equal(graph.object_ids[graph.core.boxes.object], shown[shown >= 0])
    np.testing.assert_allclose(graph.core.boxes.covariance, _covariances(graph.core.boxes.box))


def _covariances(boxes):
    side = np.tile(boxes[:, 2:] - boxes[:, :2], 2)
    return (np.eye(4) * (1.0 + (0.02 * side[:, None]) ** 2)).reshape(-1, 16)


def test_what_was_left_out_is_not_in_the_graph(found):
    gone = int(np.flatnonzero(found.object_ids == 3)[0])
    scene = found.scene
    before, scene.labels.dropped = scene.labels.dropped, {gone: "it moves"}
    graph = found.build_graph()
    scene.labels.dropped = before
    assert graph.object_ids.tolist() == [0, 1, 2, 4, 5, 6, 7]
    start = found.start(graph)
    rows = [int(np.flatnonzero(found.object_ids == number)[0]) for number in graph.object_ids]
    np.testing.assert_array_equal(start.landmarks, scene.ellipsoids[rows])


def test_nothing_found_is_nothing_to_solve(made):
    none = made.recording.detections.select(np.zeros(0, dtype=np.int64))
    found = dq.associate(replace(made.recording, detections=none))
    assert repr(found) == "Association(0 objects, 0 of 0 boxes)"
    with pytest.raises(ValueError, match="associate has found no object at rest"):
        found.build_graph()


def test_an_association_in_a_line(made, found):
    shown = int(np.sum(found.object_id >= 0))
    assert repr(found) == f"Association(8 objects, {shown} of {len(made.thing)} boxes)"
    dropped = replace(found, dropped={3: "it moves"})
    assert repr(dropped).endswith("boxes, 1 dropped)")
