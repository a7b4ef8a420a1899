"""tracks.csv: what is written is read, and mistakes name their line."""

import dataclasses
import json
import re

import numpy as np
import pytest

import dqslam as dq
from dqslam.io.files import FileError
from dqslam.io.results.tracks import read_tracks, write_tracks
from dqslam.track import Track

TIMES = np.array([0.0, 0.25, 0.5, 0.75])


def made(track_id=0, pose=(1, 2, 3), behavior="moves"):
    random, count = np.random.default_rng(track_id), len(pose)
    turns = random.normal(size=(count, 4))
    root = random.normal(size=(count, 3, 3))
    return Track(
        track_id,
        "car",
        behavior,
        0.999,
        np.array(pose),
        random.normal(size=(count, 3)),
        turns / np.linalg.norm(turns, axis=1, keepdims=True),
        *random.normal(size=(3, count)),
        np.arange(count) > 0,
        np.array([4.0, 2.0, 1.5]),
        root @ root.transpose(0, 2, 1),
        *random.uniform(0.1, 1.0, (3, count)),
        np.array([0.1, 0.2, 0.3]),
    )


def test_tracks_are_read_as_written(tmp_path):
    tracks = made(0), made(4, (0, 2), "stops and goes")
    write_tracks(tmp_path / "tracks.csv", tracks, TIMES)
    found = read_tracks(tmp_path / "tracks.csv", TIMES)
    assert len(found) == 2
    for one, other in zip(tracks, found, strict=True):
        for field in dataclasses.fields(Track):
            before, after = getattr(one, field.name), getattr(other, field.name)
            if isinstance(before, np.ndarray):
                np.testing.assert_allclose(after, before, rtol=1e-8)
            else:
                assert after == before
    assert repr(found[1]).startswith("Track(4, 'car' stops and goes, 2 images, ")


@pytest.mark.parametrize(
    ("column", "cell", "message"),
    [
        ("timestamp", "0.3", "tracks.csv:3: timestamp 0.3 is of no pose"),
        ("timestamp", "0.25", "tracks.csv:3: time does not increase in its track"),
        ("probability", "1.5", "tracks.csv:3: probability is 1.5, not between 0 and 1"),
        ("behavior", "flies", "tracks.csv:3: behavior is flies, not moves or stops and goes"),
        ("class_name", "bus", "tracks.csv:3: class_name is bus, not that of the row before"),
        ("length", "0", "tracks.csv:3: a side is not positive"),
        ("qw", "9", "tracks.csv:3: quaternion is not of unit length"),
        ("track_id", "7", "tracks.csv:4: track_id 0 has rows elsewhere"),
        ("speed", "fast", "tracks.csv:3: speed is 'fast', not a number"),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path, column, cell, message):
    path = tmp_path / "tracks.csv"
    write_tracks(path, [made()], TIMES)
    lines = [line.split(",") for line in path.read_text().splitlines()]
    lines[2][lines[0].index(column)] = cell
    path.write_text("\n".join(",".join(line) for line in lines) + "\n")
    with pytest.raises(FileError, match=re.escape(message)):
        read_tracks(path, TIMES)


def test_tracks_are_among_the_files_of_results(tmp_path):
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
    estimate, _ = dq.solve(dq.build_graph(recording))
    dq.save_estimate(estimate, tmp_path / "none")
    assert not (tmp_path / "none" / "tracks.csv").exists()
    assert dq.load_results(tmp_path / "none").tracks == ()
    moving = dataclasses.replace(estimate, tracks=(made(),))
    assert repr(moving).endswith("10 objects, 1 track)")
    dq.save_estimate(moving, tmp_path / "one")
    (track,) = dq.load_results(tmp_path / "one").tracks
    np.testing.assert_array_equal(track.pose, [1, 2, 3])
    (entry,) = json.loads((tmp_path / "one" / "map.json").read_text())["tracks"]
    assert (entry["id"], entry["images"], entry["sides"]) == (0, 3, [4.0, 2.0, 1.5])
    assert entry["first_timestamp"] == estimate.timestamps[1]


def test_corners_are_at_half_the_sides():
    track = dataclasses.replace(made(), orientations=np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)))
    corners = track.corners() - track.centers[:, None]
    np.testing.assert_allclose(np.abs(corners), np.tile([2.0, 1.0, 0.75], (3, 8, 1)))
    assert len(np.unique(corners[0], axis=0)) == 8
