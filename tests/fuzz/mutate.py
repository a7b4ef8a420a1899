"""Mutations of files: of their bytes, their lines and their numbers, all from a seed."""

import random
import re
from pathlib import Path

NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
TOKENS = (
    b"nan", b"inf", b"-inf", b"0", b"-0", b"-1", b"1e308", b"-1e308", b"1e-320", b"1e400",
    b"9223372036854775808", b"-9223372036854775809", b"4294967296", b"1e6", b"1.7e12", b"0x10",
    b"1_000", b"1,5", b"", b" ", b"null", b"true", b"[]", b"{}", b'""', b"\x00", b"\xff\xfe",
    b"\xef\xbb\xbf", b"\r\n", b"\n", b'"', b"'", b",", b";", b"#", b"\t", b"$\\frac$", b"\x1b[2J",
    "１２".encode(), "茶".encode(), b"!!python/object:os.system", b"&a [*a]", b"[" * 3000,
)  # fmt: skip


def mutate(content: bytes, rng: random.Random) -> bytes:
    """Return a content that was changed some times."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        content = rng.choice(_MUTATIONS)(content, rng)
    return content


def mutate_file(path: Path, rng: random.Random) -> None:
    """Change a file, or one of the files of a folder, or take it away."""
    if path.is_dir():
        files = sorted(one for one in path.rglob("*") if one.is_file())
        if not files or rng.random() < 0.05:
            (path / rng.choice(("0.txt", "a b.txt", "x"))).write_bytes(rng.choice(TOKENS))
            return
        path = rng.choice(files)
        if rng.random() < 0.05:
            path.unlink()
            return
    path.write_bytes(mutate(path.read_bytes(), rng))


def _flip(content: bytes, rng: random.Random) -> bytes:
    if not content:
        return content
    changed = bytearray(content)
    changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def _cut(content: bytes, rng: random.Random) -> bytes:
    begin, end = _span(content, rng)
    return content[:begin] + content[end:]


def _repeat(content: bytes, rng: random.Random) -> bytes:
    begin, end = _span(content, rng)
    return content[:end] + content[begin:end] * rng.choice((1, 1, 2, 20)) + content[end:]


def _truncate(content: bytes, rng: random.Random) -> bytes:
    return content[: rng.randrange(len(content) + 1)]


def _insert(content: bytes, rng: random.Random) -> bytes:
    place = rng.randrange(len(content) + 1)
    return content[:place] + rng.choice(TOKENS) + content[place:]


def _replace_number(content: bytes, rng: random.Random) -> bytes:
    numbers = list(NUMBER.finditer(content))
    if not numbers:
        return content
    chosen = rng.choice(numbers)
    value = rng.choice(TOKENS)
    if rng.random() < 0.5:
        value = repr(float(chosen[0]) * rng.choice((-1.0, 1e3, 1e-3, 1e9, 0.0, 1.0001))).encode()
    return content[: chosen.start()] + value + content[chosen.end() :]


def _move_lines(content: bytes, rng: random.Random) -> bytes:
    lines = content.split(b"\n")
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


def _change_words(content: bytes, rng: random.Random) -> bytes:
    words = re.split(rb"([\s,;:]+)", content)
    if len(words) < 3:
        return content
    place = rng.randrange(len(words))
    words[place] = rng.choice((rng.choice(TOKENS), rng.choice(words), b""))
    return b"".join(words)


def _span(content: bytes, rng: random.Random) -> tuple[int, int]:
    begin = rng.randrange(len(content) + 1)
    return begin, min(len(content), begin + rng.choice((1, 2, 5, 20, 200)))


_MUTATIONS = (
    _flip, _cut, _repeat, _truncate, _insert, _replace_number, _replace_number, _replace_number,
    _move_lines, _change_words, _change_words,
)  # fmt: skip
