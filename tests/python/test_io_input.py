"""Files as .gz, standard input and pipes."""

import gzip
import io
import os
import threading

import numpy as np
import pytest

from dqslam import _input
from dqslam.io import FileError, read_camera, read_detections, read_trajectory

CSV = "timestamp,x1,y1,x2,y2\n0.5,10,20,30,50\n0.5,11,20,30,50\n0.75,12,20,30,50\n"
TUM = "0 1 2 3 0 0 0 1\n1 1 2 4 0 0 0 1\n"


@pytest.fixture
def stdin(monkeypatch):
    def give(text):
        _input._stdin.cache_clear()
        stream = io.TextIOWrapper(io.BytesIO(text.encode()))
        monkeypatch.setattr("sys.stdin", stream)

    yield give
    _input._stdin.cache_clear()


def test_packed_files_are_those_that_were_packed(tmp_path):
    for name, text in (("boxes.csv.gz", CSV), ("path.txt.gz", TUM)):
        (tmp_path / name).write_bytes(gzip.compress(text.encode()))
    table = read_detections(tmp_path / "boxes.csv.gz")
    # Boxes of one time are of one image.
    assert table.frame.tolist() == [0, 0, 1]
    assert table.box[:, 0].tolist() == [10, 11, 12]
    assert read_trajectory(tmp_path / "path.txt.gz").world_from_camera[1, 2] == 4
    camera = '{"fx": 1, "fy": 2, "cx": 3, "cy": 4, "width": 10, "height": 10}'
    (tmp_path / "camera.json.gz").write_bytes(gzip.compress(camera.encode()))
    assert read_camera(tmp_path / "camera.json.gz").fy == 2


def test_standard_input_is_recognized_by_its_content(stdin):
    stdin(CSV)
    assert len(read_detections("-")) == 3
    stdin(TUM)
    np.testing.assert_array_equal(read_trajectory("-").timestamps, [0, 1])
    stdin('[{"image_id": 4, "category_id": 3, "bbox": [10, 20, 30, 40], "timestamp": 2}]')
    assert read_detections("-").timestamp.tolist() == [2]
    stdin("")
    with pytest.raises(FileError, match="-: is empty"):
        read_detections("-")


def test_standard_input_is_one_of_the_inputs_only():
    _input.refuse_shared_input("-", "a", None)
    with pytest.raises(ValueError, match="-: standard input can be only one of the inputs"):
        _input.refuse_shared_input("-", "a", "-")


def test_a_pipe_is_read_once(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    writer = threading.Thread(target=path.write_text, args=(CSV,), daemon=True)
    writer.start()
    assert len(read_detections(path)) == 3
    writer.join(timeout=10)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"no gzip", "boxes.csv.gz: is no gzip file that can be read"),
        (gzip.compress(CSV.encode(), mtime=0)[:-12], "is no gzip file that can be read"),
        (gzip.compress(b"", mtime=0), "is empty"),
        (gzip.compress(b"\xff\xfe", mtime=0), "is not a text file"),
    ],
)
def test_what_is_no_packed_text(tmp_path, content, message):
    path = tmp_path / "boxes.csv.gz"
    path.write_bytes(content)
    with pytest.raises(FileError, match=message):
        read_detections(path)


def test_a_small_file_that_unpacks_to_a_huge_one_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(_input, "MOST_BYTES", 2**22)
    path = tmp_path / "boxes.csv.gz"
    path.write_bytes(gzip.compress(b"timestamp,x1,y1,x2,y2\n" + b"0" * 2**23))
    with pytest.raises(FileError, match="unpacks to more than"):
        read_detections(path)


def test_lines_end_as_on_any_system(tmp_path):
    path = tmp_path / "boxes.csv"
    path.write_bytes(CSV.replace("\n", "\r\n").encode("utf-8-sig"))
    assert read_detections(path).line.tolist() == [2, 3, 4]
