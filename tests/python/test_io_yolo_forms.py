"""What Ultralytics writes: tracks with and without scores, segments, turned boxes, key points."""

import numpy as np
import pytest

from dqslam.io import FileError, Notes, frame_rate, read_detections

SIZE = {"width": 100, "height": 200}
HZ = frame_rate(10)


def read(tmp_path, *files, start=0, **more):
    folder = tmp_path / "labels"
    folder.mkdir()
    for number, text in enumerate(files, start=start):
        (folder / f"clip_{number}.txt").write_text(text)
    notes = more.pop("notes", Notes())
    return read_detections(folder, **{**SIZE, "frames": HZ, "notes": notes, **more})


def px(*shares):
    """Return corners in pixels of shares of the image."""
    return np.array(shares) * [100, 200, 100, 200] - 0.5


def test_tracks_without_scores(tmp_path):
    notes = Notes()
    lines = ["0 0.5 0.5 0.2 0.4 0\n1 0.25 0.5 0.1 0.1 1\n", "0 0.5 0.5 0.2 0.4 0\n"]
    table = read(tmp_path, *lines, notes=notes)
    assert table.track_id.tolist() == [0, 1, 0]
    assert table.score.tolist() == [1, 1, 1]
    np.testing.assert_allclose(table.box[0], px(0.4, 0.3, 0.6, 0.7), atol=1e-12)
    assert "taken for the id of a track" in notes.sentences()[0]


def test_tracks_with_scores_where_some_lack_the_id(tmp_path):
    table = read(tmp_path, "0 0.5 0.5 0.2 0.4 0.75 12\n", "0 0.5 0.5 0.2 0.4 0.5\n")
    assert table.track_id.tolist() == [12, -1]
    assert table.score.tolist() == [0.75, 0.5]


@pytest.mark.parametrize("scores", [("0.9", "1"), ("1", "1")])
def test_scores_are_no_ids(tmp_path, scores):
    line = "0 0.5 0.5 0.2 0.4 {}\n"
    table = read(tmp_path, "".join(line.format(score) for score in scores))
    assert table.score.tolist() == [float(score) for score in scores]
    assert table.track_id is None


@pytest.mark.parametrize(
    ("end", "score", "track"), [("", 1, None), (" 0.25", 0.25, None), (" 0.25 7", 0.25, [7, 7])]
)
def test_segments_become_the_box_around_them(tmp_path, end, score, track):
    shapes = ["0.3 0.4 0.7 0.45 0.5 0.9 0.35 0.6 0.3 0.5", "0.1 0.2 0.3 0.4 0.2 0.6 0.15 0.3"]
    table = read(tmp_path, "".join(f"3 {shape}{end}\n" for shape in shapes))
    np.testing.assert_allclose(table.box[0], px(0.3, 0.4, 0.7, 0.9), atol=1e-12)
    np.testing.assert_allclose(table.box[1], px(0.1, 0.2, 0.3, 0.6), atol=1e-12)
    assert table.score.tolist() == [score, score]
    assert (None if table.track_id is None else table.track_id.tolist()) == track


def test_a_triangle_is_no_box_that_leaves_the_image(tmp_path):
    table = read(tmp_path, "0 0.2 0.3 0.9 0.35 0.6 1\n")
    np.testing.assert_allclose(table.box[0], px(0.2, 0.3, 0.9, 1), atol=1e-12)
    assert table.score[0] == 1


@pytest.mark.parametrize(("end", "score"), [("", 1), (" 0.5", 0.5), (" 0.5 3", 0.5)])
def test_turned_boxes(tmp_path, end, score):
    corners = "0.5 0.3 0.7 0.4 0.5 0.5 0.3 0.4"
    table = read(tmp_path, f"2 {corners}{end}\n" * 2)
    np.testing.assert_allclose(table.box[0], px(0.3, 0.3, 0.7, 0.5), atol=1e-12)
    assert (table.score[0], table.class_id[0]) == (score, 2)


@pytest.mark.parametrize("end", ["", " 0.5", " 0.5 3"])
@pytest.mark.parametrize("visible", ["", " 2"])
def test_key_points_are_within_their_box(tmp_path, end, visible):
    points = "".join(
        f" {x} {y}{visible}" for x, y in ((0.45, 0.35), (0.5, 0.6), (0, 0), (0.58, 0.4))
    )
    table = read(tmp_path, f"0 0.5 0.5 0.2 0.4{points}{end}\n" * 2)
    np.testing.assert_allclose(table.box[0], px(0.4, 0.3, 0.6, 0.7), atol=1e-12)
    assert table.score[0] == (0.5 if end else 1)
    assert (table.track_id is None) == (end != " 0.5 3")


def test_files_of_line_ends_are_images_without_boxes(tmp_path):
    table = read(tmp_path, "\r\n", "0 0.5 0.5 0.2 0.4 0.5\r\n", "", "\n\n")
    assert table.frame.tolist() == [1]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 50 90 20 40 0.5\n", r"clip_0\.txt:1: its numbers are pixels or percent, not shares"),
        ("0 0.5 0.5 0.2\n", r":1: 4 fields, not 5 to 7"),
        (
            "0 0.5 0.5 0.2 0.1\n0 0.1 0.1 0.2 0.1 0.2 0.3 0.1 0.3\n",
            r":1: 5 fields, but",
        ),
    ],
)
def test_what_is_no_form(tmp_path, text, message):
    with pytest.raises(FileError, match=message):
        read(tmp_path, text)


def test_times_as_names_need_no_rate(tmp_path):
    folder = tmp_path / "labels"
    folder.mkdir()
    for name in ("1311868164.363181", "1311868164.399026"):
        (folder / f"{name}.txt").write_text("0 0.5 0.5 0.2 0.4\n")
    table = read_detections(folder, **SIZE)
    assert table.timestamp.tolist() == [1311868164.363181, 1311868164.399026]
    assert table.frame.tolist() == [0, 1]


def test_the_first_frame_is_an_option(tmp_path):
    table = read(tmp_path, "0 0.5 0.5 0.2 0.4\n", "0 0.5 0.5 0.2 0.4\n", start=1, first_frame=1)
    assert table.frame.tolist() == [0, 1]
    assert table.timestamp.tolist() == [0, 0.1]
    with pytest.raises(FileError, match=r"clip_1\.txt:1: frame 1 is before the first one, 2"):
        read_detections(tmp_path / "labels", **SIZE, frames=HZ, first_frame=2)


def test_the_folder_above_the_labels_is_a_hint(tmp_path):
    (tmp_path / "track" / "labels").mkdir(parents=True)
    with pytest.raises(FileError, match=r"Is a directory; its folder .*track/labels may be what"):
        read_detections(tmp_path / "track", **SIZE)
