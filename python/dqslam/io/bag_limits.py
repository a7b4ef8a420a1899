"""Sizes that a bag declares, checked before a library believes them.

A record may not be longer than the rest of its file. A chunk may unpack to at most 1 GiB, and to
just the size that it declares: a few kilobytes can unpack to more than any memory.
"""

from __future__ import annotations

import bz2
import contextlib
import re
import struct
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from dqslam.io.files import FileError, read_text
from dqslam.io.yaml import parse_yaml

MOST_UNPACKED = 2**30  #: bytes of a chunk
MOST_FACTOR = 200  #: of a packed file, beyond that
PACKED = (".zstd", ".zst")  #: endings of packed files of rosbag2
BLOCK = 2**20
MCAP, ROS_1 = b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n"
MCAP_CHUNK, ROS_1_CHUNK = 6, 5  #: kinds of records
MOST_HEADER = 2**20  #: bytes of the header of a record of ROS 1


class Chunk(NamedTuple):
    """Where the packed data of a chunk are in a file, how they are packed, what they unpack to."""

    start: int
    packed: int
    unpacked: int
    compression: str


def check_bag(path: str | Path) -> None:
    """Refuse a bag whose records or chunks declare sizes that cannot be.

    Raises
    ------
    FileError
        For these, and for a ``metadata.yaml`` that is no plain YAML.
    """
    path = Path(path)
    if path.is_dir():
        metadata = path / "metadata.yaml"
        if metadata.is_file():
            with contextlib.suppress(RuntimeError):  # PyYAML may not be installed
                parse_yaml(metadata, read_text(metadata))
        files = sorted(file for file in path.iterdir() if file.suffix in (".mcap", *PACKED))
    else:
        files = [path]
    for file in files:
        state = file.stat()
        _check_file(file, state.st_size, state.st_mtime_ns)


@cache
def _check_file(path: Path, size: int, modified: int) -> None:
    """Check a file once, as a bag is opened for each kind of messages."""
    with path.open("rb") as data:
        if path.suffix in PACKED:
            _check_packed(path, data, size)
            return
        start = data.read(len(ROS_1))
        chunks: Iterator[Chunk] = iter(())
        if start.startswith(MCAP):
            chunks = _mcap_chunks(path, data, size)
        elif start == ROS_1:
            chunks = _ros_1_chunks(path, data, size)
        for chunk in chunks:
            _check_chunk(path, data, chunk)


def _mcap_chunks(path: Path, data: BinaryIO, size: int) -> Iterator[Chunk]:
    at = len(MCAP)
    while at + 9 <= size - len(MCAP):
        data.seek(at)
        kind, length = struct.unpack("<BQ", data.read(9))
        if at + 9 + length > size:
            raise _too_long(path, at, length, size)
        if kind == MCAP_CHUNK and length >= 40:
            # The times of its first and last message, then size, checksum, and a name.
            _, _, unpacked, _, name_length = struct.unpack("<QQQII", data.read(32))
            name = data.read(min(name_length, 16)).decode("ascii", "replace")
            (packed,) = struct.unpack("<Q", data.read(8))
            yield Chunk(data.tell(), min(packed, at + 9 + length - data.tell()), unpacked, name)
        at += 9 + length


def _ros_1_chunks(path: Path, data: BinaryIO, size: int) -> Iterator[Chunk]:
    at = len(ROS_1)
    while at + 4 <= size:
        data.seek(at)
        (header_length,) = struct.unpack("<I", data.read(4))
        if at + 8 + header_length > size or header_length > MOST_HEADER:
            raise _too_long(path, at, header_length, size)
        header = data.read(header_length)
        (length,) = struct.unpack("<I", data.read(4))
        start = at + 8 + header_length
        if start + length > size:
            raise _too_long(path, at, length, size)
        if bytes((*b"op=", ROS_1_CHUNK)) in header:
            name = re.search(rb"compression=(\w+)", header)
            unpacked = re.search(rb"size=(.{4})", header, re.DOTALL)
            if name and unpacked:
                (declared,) = struct.unpack("<I", unpacked[1])
                yield Chunk(start, length, declared, name[1].decode())
        at = start + length


def _check_packed(path: Path, data: BinaryIO, size: int) -> None:
    """Refuse a packed file that unpacks to far more than its size and 1 GiB."""
    most = max(MOST_UNPACKED, MOST_FACTOR * size)
    unpack, found = _zstd().ZstdDecompressor(), 0
    try:
        while not unpack.eof and found <= most:
            block = data.read(BLOCK) if unpack.needs_input else b""
            if not block and unpack.needs_input:
                break  # its end is missing, which its reader says
            found += len(unpack.decompress(block, BLOCK))
    except Exception as error:  # the codec has errors of its own
        raise FileError(path, f"is no bag that can be read: {str(error)[:200]}") from None
    if found > most:
        raise FileError(path, f"unpacks to more than {most} bytes")


def _zstd() -> Any:
    """Return the module that unpacks Zstandard, one that rosbags needs as well."""
    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd
    return zstd


def _check_chunk(path: Path, data: BinaryIO, chunk: Chunk) -> None:
    if chunk.unpacked > MOST_UNPACKED:
        message = f"a chunk declares {chunk.unpacked} bytes, more than {MOST_UNPACKED >> 30} GiB"
        raise FileError(path, message)
    if chunk.compression in ("", "none"):
        return
    data.seek(chunk.start)
    unpack: Any = None
    if chunk.compression == "bz2":
        unpack = bz2.BZ2Decompressor()
    elif chunk.compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        unpack = LZ4FrameDecompressor()
    elif chunk.compression == "zstd":
        unpack = _zstd().ZstdDecompressor()
    else:
        return  # its reader does not know it either
    try:
        found = len(unpack.decompress(data.read(chunk.packed), chunk.unpacked + 1))
    except Exception as error:  # each of the codecs has errors of its own
        raise FileError(path, f"is no bag that can be read: {str(error)[:200]}") from None
    if found > chunk.unpacked:
        raise FileError(
            path, f"a chunk unpacks to more than the {chunk.unpacked} bytes it declares"
        )


def _too_long(path: Path, at: int, length: int, size: int) -> FileError:
    message = f"a record declares {length} bytes at byte {at} of a file of {size}"
    return FileError(path, f"is no bag that can be read: {message}")
