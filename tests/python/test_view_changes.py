"""What has changed, in the scene of the later map."""

import json
from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam.cli import main
from dqslam.io import FileError
from dqslam.places.changes.files import write_changes
from dqslam.view import build_scene
from dqslam.view.changes import COLORS, with_changes


@pytest.fixture(scope="module")
def later(tmp_path_factory):
    """A map, and the changes since another in which object 0 was elsewhere and 1 was not."""
    folder = tmp_path_factory.mktemp("later")
    recording, _ = dq.simulate(dq.load_scenario("orbit"), seed=1)
    graph = dq.build_graph(recording)
    estimate, _ = dq.solve(graph)
    marginals = dq.marginal_covariances(graph, estimate)
    kept = {"detections": recording.detections, "marginals": marginals}
    dq.save_estimate(estimate, folder / "map", **kept)
    after = dq.load_results(folder / "map")
    centers = after.objects.centers.copy()
    centers[0] += [0.4, 0.3, 0.0]
    rows = np.setdiff1d(np.arange(len(centers)), [1])
    earlier = replace(after.objects, centers=centers)
    columns = {
        name: value[rows]
        if isinstance(value, np.ndarray)
        else tuple(value[row] for row in rows if value)
        for name, value in vars(earlier).items()
        if not isinstance(value, dict)
    }
    before = replace(after, objects=replace(earlier, **columns))
    write_changes(folder, dq.changes(before, after))
    return folder


def test_objects_are_named_and_colored_by_what_became_of_them(later):
    results = dq.load_results(later / "map")
    plain = build_scene(results)
    scene = with_changes(plain, later / "changes.json")
    told = {
        one["second_id"]: one for one in json.loads((later / "changes.json").read_text())["objects"]
    }
    assert told[0]["status"] == "moved"
    assert told[1]["status"] == "appeared"
    moved, appeared, stayed = scene.objects[0], scene.objects[1], scene.objects[2]
    assert (moved.class_name, moved.color) == (
        f"{plain.objects[0].class_name}: moved",
        COLORS["moved"],
    )
    assert moved.numbers[0][1].endswith("by 0.5 m")
    assert appeared.color == COLORS["appeared"]
    assert stayed.class_name.endswith(": stayed")
    left = scene.objects[len(results.objects)]
    assert left.class_name == f"{plain.objects[0].class_name}: left"
    np.testing.assert_allclose(left.center - moved.center, [0.4, 0.3, 0.0], atol=0.05)
    assert len(scene.objects) == len(results.objects) + 1
    assert scene.overview[-1] == ("changes", "6 stayed, 1 moved, 1 appeared")


def test_the_page_has_them(later, tmp_path):
    page = tmp_path / "page"
    given = ["view", str(later / "map"), "--changes", str(later / "changes.json")]
    assert main([*given, "--export", str(page), "--ply", str(tmp_path / "map.ply")]) == 0
    text = (page / "scene.js").read_text()
    assert ": appeared" in text
    assert ": left" in text


def test_changes_of_another_map_are_named(later, tmp_path):
    scene = build_scene(dq.load_results(later / "map"))
    path = tmp_path / "changes.json"
    content = json.loads((later / "changes.json").read_text())
    content["objects"][3]["second_id"] = 99
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match="objects row 3: object 99 is not in the map"):
        with_changes(scene, path)
    del content["objects"][3]["status"]
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match="objects row 3: no status"):
        with_changes(scene, path)
    path.write_text("{}")
    with pytest.raises(FileError, match="has no list of objects"):
        with_changes(scene, path)
