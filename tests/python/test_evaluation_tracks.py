"""Tracks against true ones, by hand, and the files of true tracks."""

import json
from dataclasses import replace

import numpy as np
import pytest

import planted
from dqslam import io
from dqslam.cli import main
from dqslam.evaluation import evaluate_tracks
from dqslam.io.files import FileError
from dqslam.io.results.tracks import write_tracks
from dqslam.metrics import Alignment
from dqslam.track import Track

NONE = Alignment(np.eye(3), np.zeros(3))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return planted.write_planted(tmp_path_factory.mktemp("planted"))


@pytest.fixture
def results(files):
    return io.load_results(files.results)


def along_x(pose, start, speed, times, track_id=0):
    """A car that goes along x, with sigmas of 0.5 m and 0.25 m/s."""
    count = len(pose)
    centers = np.zeros((count, 3))
    centers[:, 0] = start + speed * times[pose]
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    zeros, ones = np.zeros(count), np.ones(count)
    return Track(
        track_id,
        "car",
        "moves",
        1.0,
        np.array(pose),
        centers,
        turns,
        zeros,
        np.full(count, speed),
        zeros,
        ones > 0.0,
        np.array([4.0, 2.0, 1.5]),
        np.tile(0.25 * np.eye(3), (count, 1, 1)),
        0.1 * ones,
        0.25 * ones,
        0.1 * ones,
        np.full(3, 0.1),
    )


def true_track(times, start, speed, track_id=7):
    centers = np.zeros((len(times), 3))
    centers[:, 0] = start + speed * times
    return io.TrueTrack(track_id, times, centers, np.full(len(times), speed))


def test_errors_of_a_track_are_those_by_hand(results):
    """1 m behind at first, and 0.5 m/s too fast."""
    times = results.timestamps
    track = along_x([2, 3, 4, 6], -1.0, 5.5, times)
    true = [true_track(times, 0.0, 5.0)]
    found = evaluate_tracks(replace(results, tracks=(track,)), true, NONE, gate=100.0)
    off = -1.0 + 0.5 * times[[2, 3, 4, 6]]
    step = times[1] - times[0]
    (pair,) = found["pairs"]
    assert (pair["id"], pair["true_id"], pair["images"]) == (0, 7, 4)
    assert pair["position"] == pytest.approx(np.median(np.abs(off)))
    assert pair["motion"] == pytest.approx(0.5 * step)  # the step over a gap does not count
    assert pair["speed"] == pytest.approx(0.5)
    assert pair["nees"] == pytest.approx(np.mean(off**2 / 0.25) / 3.0)
    assert pair["speed_nees"] == pytest.approx(4.0)
    assert (found["found"], found["missed"], found["split"], found["invented"]) == (1, 0, 0, 0)


def test_tracks_are_counted(results):
    """Two parts of one thing, one of nothing, and a thing that none shows."""
    times = results.timestamps
    tracks = (
        along_x([0, 1, 2], 0.0, 5.0, times, 0),
        along_x([4, 5, 6], 0.1, 5.0, times, 1),
        along_x([0, 1, 2], 40.0, 5.0, times, 2),
    )
    truth = [true_track(times, 0.0, 5.0, 7), true_track(times, -50.0, 5.0, 8)]
    found = evaluate_tracks(replace(results, tracks=tracks), truth, NONE)
    assert (found["found"], found["missed"], found["split"], found["invented"]) == (1, 1, 1, 1)
    wide = evaluate_tracks(replace(results, tracks=tracks), truth, NONE, gate=60.0)
    assert (wide["found"], wide["split"], wide["invented"]) == (1, 2, 0)
    late = [true_track(times + 100.0, 0.0, 5.0)]
    none = evaluate_tracks(replace(results, tracks=tracks), late, NONE)
    assert (none["found"], none["invented"], none["nees_mean"]) == (0, 3, None)


def test_a_scale_and_a_turn_between_the_worlds_are_removed(results):
    times = results.timestamps
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    truth = true_track(times, 0.0, 10.0)
    truth = replace(truth, centers=truth.centers @ turn.T + [1.0, 2.0, 3.0])
    track = along_x([0, 1, 2, 3], 0.0, 5.0, times)
    alignment = Alignment(turn, np.array([1.0, 2.0, 3.0]), 2.0)
    found = evaluate_tracks(replace(results, tracks=(track,)), [truth], alignment)
    for name in ("position_median", "motion_median", "speed_median", "nees_mean"):
        assert found[name] == pytest.approx(0.0, abs=1e-12)


def test_true_tracks_are_read_with_their_speeds_or_without(tmp_path):
    path = tmp_path / "true.csv"
    path.write_text("id,timestamp,x,y,z\n3,0,0,0,0\n1,0,9,9,9\n3,0.5,1,0,0\n3,1,4,0,0\n")
    single, thing = io.read_true_tracks(path)
    assert (single.track_id, thing.track_id) == (1, 3)
    assert np.isnan(single.speeds).all()
    # Over half a second before and after: 1 m in 0.5 s, 4 m in 1 s, 3 m in 0.5 s.
    np.testing.assert_allclose(thing.speeds, [2.0, 4.0, 6.0])
    path.write_text("track_id,timestamp,x,y,z,speed\n3,0,0,0,0,-2\n")
    np.testing.assert_allclose(io.read_true_tracks(path)[0].speeds, [2.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("timestamp,x,y,z\n0,0,0,0\n", "no column track_id"),
        ("track_id,timestamp,x,y\n0,0,0,0\n", "no column z"),
        ("track_id,timestamp,x,y,z\n0,1,0,0,0\n1,0,0,0,0\n0,1,0,0,0\n", ":4: time does not"),
        ("track_id,timestamp,x,y,z\n0,1,0,nan,0\n", ":2: y"),
    ],
)
def test_mistakes_in_true_tracks_name_the_line(tmp_path, text, message):
    path = tmp_path / "true.csv"
    path.write_text(text)
    with pytest.raises(FileError) as caught:
        io.read_true_tracks(path)
    assert message in str(caught.value)


def test_the_command_compares_tracks(files, results, capsys):
    times = results.timestamps
    write_tracks(files.results / "tracks.csv", [along_x([0, 1, 2], 0.0, 5.0, times)], times)
    truth = files.results.parent / "true_tracks.csv"
    write_tracks(truth, [along_x(list(range(5)), 0.2, 5.0, times, 9)], times)
    arguments = ["evaluate", str(files.results), "--groundtruth"]
    arguments += [str(files.results / "trajectory.txt"), "--tracks", str(truth)]
    assert main(arguments) == 0
    assert "tracks: 1 found, 0 missed, 0 split, 0 invented" in capsys.readouterr().out
    written = json.loads((files.results / "evaluation.json").read_text())["tracks"]
    assert written["position_median"] == pytest.approx(0.2, abs=1e-6)
    page = (planted.Path(__file__).parents[2] / "docs" / "evaluation.md").read_text()
    table = page[page.index("## `evaluation.json`") :]
    names = {*written, *written["pairs"][0]}
    assert {name for name in names if f"`{name}`" not in table} == set()
