"""Whether frames count from 0, by the poses beside them."""

import numpy as np
import pytest

from dqslam.io import Notes, frame_rate, read_detections
from dqslam.io.first_frame import with_first_frame

HZ = frame_rate(5)
POSES = np.arange(20) / 5


def read(tmp_path, numbers, text="{},1,10,20,30,40,0.9\n", **more):
    path = tmp_path / "boxes.txt"
    path.write_text("".join(text.format(number) for number in numbers))
    notes = Notes()
    table = read_detections(path, frames=HZ, notes=notes, **more)
    return with_first_frame(table, POSES, HZ, notes), notes.sentences()


def test_mot_counts_from_1(tmp_path):
    table, notes = read(tmp_path, range(1, 21))
    assert (table.frame[0], table.timestamp[-1], notes) == (0, 3.8, [])


def test_a_frame_0_in_mot(tmp_path):
    table, notes = read(tmp_path, range(20))
    assert (table.frame[0], table.timestamp[-1]) == (0, 3.8)
    assert "there is a frame 0: frames count from 0" in notes[0]


@pytest.mark.parametrize("first", [2, 5, 100])
def test_as_many_frames_as_poses(tmp_path, first):
    table, notes = read(tmp_path, range(first, first + 20))
    assert (table.frame[0], table.timestamp[-1]) == (0, pytest.approx(3.8))
    assert f"frame {first - 1} is taken for the first one" in notes[0]
    # What the user says goes before.
    table, notes = read(tmp_path, range(first, first + 20), first_frame=1)
    assert (table.frame[0], notes) == (first - 1, [])


def test_less_clear_cases_are_noted_only(tmp_path):
    table, notes = read(tmp_path, range(4, 22))
    assert (table.frame[0], table.frame[-1]) == (3, 20)
    assert "do frames begin with another number? --first-frame N" in notes[0]
    table, notes = read(tmp_path, range(2, 20))
    assert table.frame[0] == 1
    assert "does the file count from 1?" in notes[0]
    assert read(tmp_path, range(3, 20))[1] == []
