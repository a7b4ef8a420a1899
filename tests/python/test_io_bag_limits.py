"""Bags that declare more than they hold."""

import struct

import pytest

from dqslam.io import FileError, bag_limits, read_trajectory

pytest.importorskip("rosbags", reason="rosbags is not installed: pip install 'dqslam[rosbag]'")
lz4 = pytest.importorskip("lz4.frame")

MCAP = b"\x89MCAP0\r\n"


def record(kind, content, length=None):
    return struct.pack("<BQ", kind, len(content) if length is None else length) + content


def chunk(data, unpacked, compression):
    head = struct.pack("<QQQI", 0, 1, unpacked, 0)
    return (
        head
        + struct.pack("<I", len(compression))
        + compression
        + struct.pack("<Q", len(data))
        + data
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (record(6, b"", 2**60), r"a record declares 1152921504606846976 bytes at byte 8 of a file"),
        (
            record(6, chunk(b"x" * 40, 2**40, b"")),
            "a chunk declares 1099511627776 bytes, more than",
        ),
        (
            record(6, chunk(lz4.compress(b"0" * 2**24), 100, b"lz4")),
            "a chunk unpacks to more than the 100 bytes it declares",
        ),
        (record(6, chunk(b"no lz4 at all", 100, b"lz4")), "is no bag that can be read"),
    ],
)
def test_mcap(tmp_path, content, message):
    path = tmp_path / "a.mcap"
    path.write_bytes(MCAP + content + MCAP)
    with pytest.raises(FileError, match=message):
        read_trajectory(path)


def field(name, value):
    return struct.pack("<I", len(name) + 1 + len(value)) + name + b"=" + value


@pytest.mark.parametrize(
    ("size", "length", "message"),
    [
        (2**31, None, "a chunk declares 2147483648 bytes"),
        (100, None, "a chunk unpacks to more than the 100 bytes it declares"),
        (100, 2**31, "a record declares 2147483648 bytes at byte 13"),
    ],
)
def test_ros_1(tmp_path, size, length, message):
    data = lz4.compress(b"0" * 2**20)
    header = field(b"op", b"\x05") + field(b"compression", b"lz4")
    header += field(b"size", struct.pack("<I", size))
    length = len(data) if length is None else length
    content = struct.pack("<I", len(header)) + header + struct.pack("<I", length) + data
    path = tmp_path / "a.bag"
    path.write_bytes(b"#ROSBAG V2.0\n" + content)
    with pytest.raises(FileError, match=message):
        read_trajectory(path)


def test_metadata_is_plain_yaml(tmp_path):
    (tmp_path / "metadata.yaml").write_text("a: &a [1, 2]\nb: [*a, *a]\n")
    with pytest.raises(FileError, match=r"metadata\.yaml:2: has an alias, \*a"):
        read_trajectory(tmp_path)


def test_a_packed_bag_that_unpacks_to_far_more(tmp_path, monkeypatch):
    zstd = pytest.importorskip("backports.zstd")
    monkeypatch.setattr(bag_limits, "MOST_UNPACKED", 2**20)
    (tmp_path / "metadata.yaml").write_text("a: 1\n")
    (tmp_path / "a.db3.zstd").write_bytes(zstd.compress(b"0" * 2**24))
    with pytest.raises(FileError, match=r"a\.db3\.zstd: unpacks to more than 1048576 bytes"):
        bag_limits.check_bag(tmp_path)
    (tmp_path / "a.db3.zstd").write_bytes(zstd.compress(b"0" * 2**19))
    bag_limits.check_bag(tmp_path)
    (tmp_path / "a.db3.zstd").write_bytes(b"no zstd")
    with pytest.raises(FileError, match="is no bag that can be read"):
        bag_limits.check_bag(tmp_path)
