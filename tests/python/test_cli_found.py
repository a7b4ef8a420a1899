import json
from pathlib import Path

import planted
from dqslam.cli import main
from dqslam.cli.found import results_in, truth_of


def test_the_truth_is_in_the_results_or_beside_them(tmp_path):
    results = tmp_path / "results"
    results.mkdir()
    assert truth_of(results, None, None) == (None, None)
    beside, objects = tmp_path / "groundtruth.txt", tmp_path / "objects.csv"
    beside.write_text("")
    assert truth_of(results, None, None) == (beside, None)
    objects.write_text("")
    assert truth_of(results, None, None) == (beside, objects)
    inside = results / "groundtruth.txt"
    inside.write_text("")
    assert truth_of(results, None, None) == (inside, None)  # those beside may be of another one
    assert truth_of(results, beside, None) == (beside, None)


def test_results_of_a_simulated_recording(tmp_path):
    (tmp_path / "odometry.txt").write_text("")
    assert results_in(tmp_path) == tmp_path
    inside = tmp_path / "results"
    inside.mkdir()
    (inside / "trajectory.txt").write_text("")
    assert results_in(tmp_path) == inside
    (tmp_path / "trajectory.txt").write_text("")
    assert results_in(tmp_path) == tmp_path


def test_view_finds_both_and_says_what_it_wrote(tmp_path, capsys):
    files = planted.write_planted(tmp_path)
    files.groundtruth.rename(tmp_path / "groundtruth.txt")
    page, ply = tmp_path / "page", tmp_path / "map.ply"
    words = ["view", str(files.results), "--export", str(page), "--ply", str(ply), "--json"]
    assert main(words) == 0
    written = json.loads(capsys.readouterr().out)
    assert written == {"page": str(page / "index.html"), "ply": str(ply)}
    scene = json.loads((page / "scene.js").read_text().removeprefix("const scene = ").rstrip(";\n"))
    assert [len(run) for run in scene["truth"]] == [20]
    assert len(scene["trueObjects"]) == 6
    assert ply.read_text().startswith("ply\n")


def test_view_names_what_is_missing(tmp_path, capsys):
    assert main(["view", str(tmp_path / "nothing"), "--export", str(tmp_path / "page")]) == 2
    assert "nothing: no such directory" in capsys.readouterr().err
    assert not (tmp_path / "page").exists()


def test_the_truth_that_evaluate_was_given(tmp_path, monkeypatch, capsys):
    """`plot` and `view` after `evaluate` need not be given the truth again."""
    monkeypatch.chdir(tmp_path)
    files = planted.write_planted(tmp_path / "a")
    files.groundtruth.rename("truth.txt")
    files.objects.rename("things.csv")
    truth = ["--groundtruth", "truth.txt", "--objects", "things.csv"]
    assert main(["evaluate", str(files.results), *truth, "-q"]) == 0
    found = truth_of(files.results, None, None)
    assert [str(path) for path in found] == ["truth.txt", "things.csv"]
    assert main(["view", str(files.results), "--export", "page", "-q"]) == 0
    scene = json.loads(
        Path("page/scene.js").read_text().removeprefix("const scene = ").rstrip(";\n")
    )
    assert [len(run) for run in scene["truth"]] == [20]
    assert len(scene["trueObjects"]) == 6
    other = tmp_path / "other.txt"
    assert truth_of(files.results, other, None) == (other, None)  # what is given comes first
    capsys.readouterr()
    Path("things.csv").unlink()
    assert main(["view", str(files.results), "--export", "page", "-q"]) == 0
    assert "things.csv is not there, which `dqslam evaluate` was given" in capsys.readouterr().err
