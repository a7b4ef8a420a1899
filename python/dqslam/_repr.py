"""Short texts for what there is, and how much of it."""

import re

# Characters that steer a terminal, or the direction of writing: a name must not write commands.
_STEERING = re.compile(
    "[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)


def printable(text: str, *, keep: str = "") -> str:
    r"""Return a text with control characters as escapes like ``\x1b``, but for some to keep."""
    return _STEERING.sub(lambda one: one[0] if one[0] in keep else _escaped(one[0]), text)


def _escaped(character: str) -> str:
    number = ord(character)
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{number:04x}"


def printable_json(text: str) -> str:
    """Return JSON that means the same, without characters that steer a terminal."""
    return _STEERING.sub(lambda one: one[0] if one[0] == "\n" else f"\\u{ord(one[0]):04x}", text)


def counted(count: int, noun: str) -> str:
    """Return a number and what it counts, as in "1 box" and "2 boxes"."""
    ending = "" if count == 1 else "es" if noun.endswith(("s", "x")) else "s"
    return f"{count} {noun}{ending}"
