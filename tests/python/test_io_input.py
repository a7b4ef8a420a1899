"""Files as .gz, standard input and pipes."""

import bz2
import gzip
import io
import lzma
import os
import tarfile
import threading
import zipfile

import numpy as np
import pytest

from dqslam import _input
from dqslam.io import FileError, frame_rate, read_camera, read_detections, read_trajectory

CSV = "timestamp,x1,y1,x2,y2\n0.5,10,20,30,50\n0.5,11,20,30,50\n0.75,12,20,30,50\n"
TUM = "0 1 2 3 0 0 0 1\n1 1 2 4 0 0 0 1\n"


@pytest.fixture
def stdin(monkeypatch):
    def give(content):
        _input._stdin.cache_clear()
        data = content if isinstance(content, bytes) else content.encode()
        stream = io.TextIOWrapper(io.BytesIO(data))
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


def test_standard_input_may_be_packed(stdin):
    stdin(gzip.compress(CSV.encode()))
    assert read_detections("-").box[:, 0].tolist() == [10, 11, 12]


def packed(name, content):
    """Return the bytes of a text that is packed by another program."""
    out = io.BytesIO()
    if name == "tar":
        with tarfile.open(fileobj=out, mode="w") as archive:
            member = tarfile.TarInfo("boxes.csv")
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    elif name == "zip":
        with zipfile.ZipFile(out, "w") as archive:
            archive.writestr("boxes.csv", content)
    else:
        return {"bz2": bz2.compress, "xz": lzma.compress}[name](content)
    return out.getvalue()


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("tar", "a tar archive"),
        ("zip", "a zip archive"),
        ("bz2", "packed with bzip2"),
        ("xz", "packed with xz"),
    ],
)
def test_other_packers_are_refused_by_their_kind(tmp_path, stdin, name, what):
    data = packed(name, CSV.encode())
    for file, content in ((f"boxes.csv.{name}", data), ("boxes.csv.gz", gzip.compress(data))):
        (tmp_path / file).write_bytes(content)
        with pytest.raises(FileError, match=f"{file}: is {what}: unpack it first"):
            read_detections(tmp_path / file)
        with pytest.raises(FileError, match=f"{file}: is {what}: unpack it first"):
            read_trajectory(tmp_path / file)
    stdin(data)
    with pytest.raises(FileError, match=f"-: is {what}"):
        read_detections("-")


@pytest.mark.parametrize(
    ("begin", "what"),
    [
        (b"SQLite format 3\0" + bytes(90), "a database, as bags of ROS 2"),
        (b"\x89MCAP0\r\n" + bytes(90), "a bag .mcap."),
        (b"#ROSBAG V2.0\n" + bytes(90), "a bag of ROS 1"),
    ],
)
def test_a_bag_is_not_read_from_standard_input(stdin, begin, what):
    stdin(begin)
    with pytest.raises(FileError, match=f"-: is {what}.*bags are read from files"):
        read_detections("-")


def test_a_packed_bag_is_refused(tmp_path):
    (tmp_path / "drive.bag.gz").write_bytes(gzip.compress(b"#ROSBAG V2.0\n"))
    with pytest.raises(FileError, match="drive.bag.gz: is a packed bag: unpack it first"):
        read_trajectory(tmp_path / "drive.bag.gz")


def test_a_folder_of_packed_labels_is_as_one_of_labels(tmp_path):
    texts = {
        "000004.txt": "2 0.5 0.5 0.25 0.5\n",
        "000005.txt": " \n",
        "000007.txt": "1 0.5 0.5 0.5 1\n",
    }
    for name, text in texts.items():
        (tmp_path / f"{name}.gz").write_bytes(gzip.compress(text.encode()))
    table = read_detections(tmp_path, width=100, height=80, frames=frame_rate(2.0), first_frame=4)
    assert table.frame.tolist() == [0, 3]
    # 100 (0.5 - 0.125) - 0.5 and 80 (0.5 - 0.25) - 0.5
    np.testing.assert_allclose(table.box[0], [37, 19.5, 62, 59.5])
    (tmp_path / "000007.txt").write_text(texts["000007.txt"])
    with pytest.raises(FileError, match="has both 000007.txt and 000007.txt.gz"):
        read_detections(tmp_path, width=100, height=80, frames=frame_rate(2.0), format="yolo")


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
