"""Input: files, gzip files, and standard input (``-``), as text.

Files of gzip are those named ``.gz``, and any input that begins like one. Files of other packers
are refused by their names. What can be read only once (standard input, pipes) is kept, since the
format is recognized first.
"""

from __future__ import annotations

import codecs
import gzip
import io
import sys
import zlib
from functools import cache
from pathlib import Path

from dqslam._files import FileError

STDIN = "-"
MOST_BYTES = 2**30  #: a text that unpacks to more is refused
HEAD_BYTES = 65536  #: what is looked at to recognize a format
_BLOCK = 2**20
_GZIP = 31  # zlib's name for a stream with the header of gzip
_MAGIC_GZIP = b"\x1f\x8b"
# What is no text by its first bytes, or by those at another place: how it is called, and the way to
# read it.
_UNPACK = "unpack it first (of packed files, only those of gzip are read)"
_BAG = "bags are read from files with their own names, unpacked"
_OTHERS = (
    (0, b"BZh", "is packed with bzip2", _UNPACK),
    (0, b"\xfd7zXZ\0", "is packed with xz", _UNPACK),
    (0, b"\x28\xb5\x2f\xfd", "is packed with zstd", _UNPACK),
    (0, b"7z\xbc\xaf", "is an archive of 7-Zip", _UNPACK),
    (0, b"PK\x03\x04", "is a zip archive", _UNPACK),
    (257, b"ustar", "is a tar archive", _UNPACK),
    (0, b"SQLite format 3\0", "is a database, as bags of ROS 2 have it", _BAG),
    (0, b"\x89MCAP0", "is a bag (mcap)", _BAG),
    (0, b"#ROSBAG V", "is a bag of ROS 1", _BAG),
)


class InputWarning(UserWarning):
    """What a reader left out of a file, or doubts in it, if nobody collects its notes."""


def is_stdin(path: str | Path) -> bool:
    """Return whether a path stands for standard input."""
    return str(path) == STDIN


def exists(path: str | Path) -> bool:
    """Return whether there is a file, a folder or a pipe; standard input always is."""
    return is_stdin(path) or Path(path).exists()


def is_stream(path: str | Path) -> bool:
    """Return whether a path can be read only once: standard input, a pipe, a device."""
    return is_stdin(path) or (Path(path).exists() and not (_is_plain(path) or Path(path).is_dir()))


def plain_name(path: str | Path) -> str:
    """Return the name of a file without ``.gz``; standard input has none."""
    name = "" if is_stdin(path) else Path(path).name
    return name[:-3] if name.lower().endswith(".gz") else name


def refuse_shared_input(*paths: str | Path | None) -> None:
    """Refuse standard input for more than one of several inputs.

    Raises
    ------
    ValueError
        If two of the paths are ``-``.
    """
    if sum(path is not None and is_stdin(path) for path in paths) > 1:
        raise ValueError("-: standard input can be only one of the inputs")


def read_text(path: str | Path, *, may_be_blank: bool = False) -> str:
    """Read a UTF-8 text; a missing, unreadable or (by default) blank one is a FileError."""
    data = _content(path)
    refuse_other_files(path, data)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise FileError(path, "is not a text file (UTF-8)") from None
    if not may_be_blank and not text.strip():
        raise FileError(path, "is empty")
    # As Python's text files do, so that the numbers of lines are those of an editor.
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def read_head(path: str | Path) -> str:
    """Return the first 64 KiB of a text, cut at the end of a line if it is longer; "" if none."""
    data = _head(path)
    try:
        # A character may be cut in two at the end.
        text = codecs.getincrementaldecoder("utf-8-sig")().decode(data[:HEAD_BYTES])
    except UnicodeDecodeError:
        return ""
    return text.replace("\r\n", "\n").replace("\r", "\n")


def refuse_other_files(path: str | Path, data: bytes | None = None) -> None:
    """Refuse what begins like an archive, a file of another packer, or a bag that is no file.

    Without ``data``, the beginning of the file is read.
    """
    data = _head(path) if data is None else data
    for start, magic, what, remedy in _OTHERS:
        if data[start : start + len(magic)] == magic:
            raise FileError(path, f"{what}: {remedy}")


def _head(path: str | Path) -> bytes:
    """Return the first bytes of a file, unpacked; none if they cannot be read."""
    if is_stream(path):
        return _content(path)[: HEAD_BYTES + 1]
    try:
        with Path(path).open("rb") as file:
            data = file.read(HEAD_BYTES + 1)
    except OSError:
        return b""
    if not _is_packed(path, data):
        return data
    try:
        return zlib.decompressobj(_GZIP).decompress(data, HEAD_BYTES + 1)
    except zlib.error:
        return b""


def _is_plain(path: str | Path) -> bool:
    return Path(path).is_file()


def _is_packed(path: str | Path, data: bytes) -> bool:
    """Return whether data are packed, by the name or the first bytes, which no text has."""
    return data.startswith(_MAGIC_GZIP) or str(path).lower().endswith(".gz")


def _content(path: str | Path) -> bytes:
    try:
        if is_stdin(path):
            data = _stdin()
        elif is_stream(path):
            data = _pipe(str(path))
        else:
            data = Path(path).read_bytes()
    except FileNotFoundError:
        raise FileError(path, "no such file") from None
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror}") from None
    return _unpacked(path, data) if _is_packed(path, data) else data


@cache
def _stdin() -> bytes:
    return sys.stdin.buffer.read()


@cache
def _pipe(path: str) -> bytes:
    return Path(path).read_bytes()


def _unpacked(path: str | Path, data: bytes) -> bytes:
    """Unpack a gzip file, within a limit."""
    out = bytearray()
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            while block := file.read(_BLOCK):
                out += block
                if len(out) > MOST_BYTES:
                    raise FileError(path, f"unpacks to more than {MOST_BYTES >> 30} GiB")
    except (OSError, EOFError, zlib.error) as error:
        raise FileError(path, f"is no gzip file that can be read: {error}") from None
    return bytes(out)
