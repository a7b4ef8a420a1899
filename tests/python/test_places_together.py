"""Folders of results that are solved as one problem."""

import json
from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core
from dqslam.cli import main
from dqslam.io import FileError
from dqslam.io.results import GRAPH_FILE, read_graph
from dqslam.places import merge_graphs, read_landmarks, solve_together, solved_of
from dqslam.subgraph import rebuilt


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """The same drive twice, with boxes and odometry of other noise."""
    folder = tmp_path_factory.mktemp("drives")
    for seed, name in ((7, "a"), (8, "b")):
        recording, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
        random = np.random.default_rng(seed)
        boxes = recording.detections
        boxes = replace(boxes, box=boxes.box + random.normal(0.0, 1.0, boxes.box.shape))
        graph = dq.build_graph(replace(recording, detections=boxes))
        estimate, _ = dq.solve(graph)
        marginals = dq.marginal_covariances(graph, estimate)
        kept = {"detections": boxes, "marginals": marginals, "graph": graph}
        dq.save_estimate(estimate, folder / name, **kept)
    return folder


def test_folders_are_solved_as_their_problems_are(folders, tmp_path, capsys):
    out = tmp_path / "both"
    assert main(["merge", str(folders / "a"), str(folders / "b"), "--out", str(out)]) == 0
    assert "solved together" in capsys.readouterr().out
    described = json.loads((out / "merge.json").read_text())
    assert described["method"] == "all recordings solved as one problem"
    results = dq.load_results(out)
    own, count = dq.load_results(folders / "a"), 253
    assert len(results.poses) == 2 * count
    assert results.objects.object_ids.tolist() == own.objects.object_ids.tolist()
    saved = read_graph(out / GRAPH_FILE)
    boxes = [read_graph(folders / name / GRAPH_FILE).core.boxes for name in "ab"]
    assert len(saved.core.boxes.pose) == sum(len(one.pose) for one in boxes)
    np.testing.assert_array_equal(saved.core.boxes.box[: len(boxes[0].box)], boxes[0].box)
    # Half the noise of boxes: centers are surer than in each map, and the path of both is one.
    together = np.trace(results.objects.center_covariances, axis1=1, axis2=2)
    alone = np.trace(own.objects.center_covariances, axis1=1, axis2=2)
    assert (together < alone).all()
    np.testing.assert_allclose(results.poses[count, :3], results.poses[0, :3], atol=0.1)
    moved = np.array(described["parts"][1]["merged_from_map"])
    np.testing.assert_allclose(moved, np.eye(4), atol=0.1)
    assert np.linalg.eigvalsh(np.array(described["parts"][1]["covariance"])).max() < 0.1


def test_a_merged_folder_is_merged_again_and_continued(folders, tmp_path):
    dq.merge(folders / "a", folders / "b", out=tmp_path / "two")
    three = dq.merge(tmp_path / "two", folders / "b")
    assert three.solved is not None and three.parts[1].why_fused == ""
    assert len(three.solved.graph.timestamps) == 3 * 253
    slam = dq.OnlineSlam.load(tmp_path / "two")
    mount = read_graph(folders / "a" / GRAPH_FILE).core.camera.robot_from_camera
    np.testing.assert_array_equal(slam.camera.robot_from_camera, mount)
    assert len(slam.objects.object_ids) == 10


def test_maps_without_a_problem_are_fused_after_the_others(folders):
    bare = replace(read_landmarks(folders / "b"), results=None, name="bare.csv")
    merged = dq.merge(folders / "a", bare, folders / "b")
    assert [part.name for part in merged.parts] == [
        str(folders / "a"),
        str(folders / "b"),
        "bare.csv",
    ]
    assert merged.parts[1].why_fused == ""
    assert merged.parts[2].why_fused == "bare.csv is no folder of results"
    assert merged.solved is None
    assert len(merged.landmarks) == 10


def test_a_problem_of_another_map_is_not_used(folders, tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        for path in (folders / name).iterdir():
            if path.name != "manifest.json":
                (tmp_path / name / path.name).write_bytes(path.read_bytes())
    content = json.loads((tmp_path / "b" / "map.json").read_text())
    content["objects"] = content["objects"][1:]
    (tmp_path / "b" / "map.json").write_text(json.dumps(content))
    merged = dq.merge(tmp_path / "a", tmp_path / "b")
    assert merged.parts[1].why_fused.endswith("is not of the map and the trajectory beside it")
    (tmp_path / "b" / GRAPH_FILE).write_bytes(b"damaged")
    with pytest.raises(FileError, match=GRAPH_FILE):
        dq.merge(tmp_path / "a", tmp_path / "b")


def test_two_objects_that_were_paired_are_parted_and_missed_pairs_are_found(folders):
    graphs, estimates = [], []
    for name in "ab":
        solved = solved_of(read_landmarks(folders / name))[0]
        graphs.append(solved.graph)
        estimates.append(solved.estimate)
    found = dq.align(folders / "a", folders / "b")
    assert len(found) == 10
    # Object 0 is taken for the nearest other one, which is left without its own pair.
    centers = estimates[0].centers
    near = int(np.argsort(np.linalg.norm(centers - centers[0], axis=1))[1])
    wrong = replace(
        found,
        a_ids=np.array([0, *[one for one in found.a_ids if one not in (0, near)]]),
        b_ids=np.array([near, *[one for one in found.a_ids if one not in (0, near)]]),
    )
    options = _core.SolveOptions(loss=_core.Loss.CAUCHY)
    joint = solve_together((graphs[0], estimates[0]), (graphs[1], estimates[1]), wrong, options)
    assert joint.merged_ids.tolist() == list(range(10))
    assert len(joint.estimate.object_ids) == 10


def test_lenses_and_bodies_are_not_one_problem(folders):
    solved = solved_of(read_landmarks(folders / "a"))[0]
    pair = (solved.graph, solved.estimate)
    lens = replace(solved.graph, lens=dq.Lens("equidistant", (0.1, 0.0, 0.0, 0.0)))
    with pytest.raises(ValueError, match="the lenses of the cameras differ"):
        merge_graphs(pair, (lens, solved.estimate))
    core = rebuilt(solved.graph.core, shapes=[_core.Shape.CUBOID] * 10)
    with pytest.raises(ValueError, match="only ellipsoids are solved together"):
        merge_graphs(pair, (replace(solved.graph, core=core), solved.estimate))


def test_a_session_keeps_its_problem(tmp_path):
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
    slam = dq.OnlineSlam(recording.camera, first_pose=recording.odometry.first_pose)
    for step in dq.steps_of(recording):
        slam.add(step.odometry, step.boxes, timestamp=step.timestamp)
    slam.polish().result()
    slam.save(tmp_path / "map")
    saved = read_graph(tmp_path / "map" / GRAPH_FILE)
    estimate = slam.estimate()
    assert saved.object_ids.tolist() == estimate.object_ids.tolist()
    np.testing.assert_allclose(saved.landmarks, estimate.ellipsoids)
    own = recording.detections.object_id[recording.detections.pose == 40]
    shown = saved.object_ids[saved.core.boxes.object[saved.core.boxes.pose == 40]]
    assert sorted(shown.tolist()) == sorted(own.tolist())
    again = dq.OnlineSlam.load(tmp_path / "map")
    again.add(None, None)
    again.save(tmp_path / "continued")  # priors of a map are no boxes: there is no problem
    assert not (tmp_path / "continued" / GRAPH_FILE).exists()
