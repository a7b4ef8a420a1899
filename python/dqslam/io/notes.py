"""What readers leave out of files, and what they doubt in them, to be said to the user."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dqslam._input import InputWarning as InputWarning
from dqslam.io.files import FileError

MAX_BAD = 0.05  #: the largest share of bad records that is left out by default


@dataclass(frozen=True)
class LeftOut:
    """Records of one file that were left out for one reason."""

    path: str
    what: str  #: "boxes" or "poses"
    reason: str
    count: int
    of: int
    first: str  #: the first of them, with its line
    bad: bool = True  #: False if they are left out because of what they are

    def __str__(self) -> str:
        """Return a sentence for people."""
        return f"{self.path}: {self.count} of {self.of} {self.what} left out: {self.first}"


@dataclass
class Notes:
    """What was left out of the files of a recording, and what is doubtful in them.

    ``max_bad`` is the largest share of the records of a file, 0 to 1, that may be bad and are left
    out; with more, the file is refused. With 0, any bad record refuses its file.
    """

    max_bad: float = MAX_BAD
    left_out: list[LeftOut] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Check the share."""
        if not 0 <= self.max_bad <= 1:
            raise ValueError(f"max_bad is {self.max_bad:g}, not between 0 and 1")

    @property
    def is_strict(self) -> bool:
        """Whether any bad record refuses its file."""
        return self.max_bad == 0

    @property
    def has_bad(self) -> bool:
        """Whether bad records were left out."""
        return any(one.bad for one in self.left_out)

    def leave_out(
        self,
        path: str | Path,
        what: str,
        reason: str,
        rows: Sequence[int],
        of: int,
        error: Callable[[int], FileError],
    ) -> None:
        """Leave out the bad ``rows`` of ``of`` records, or raise the error of the first one.

        Raises
        ------
        FileError
            If they are more than the share ``max_bad``.
        """
        if not len(rows):
            return
        first = error(int(rows[0]))
        if len(rows) > self.max_bad * of:
            more = ""
            if len(rows) > 1:
                more = f" ({len(rows)} of {of} {what} are bad, {self.max_bad:.0%} may be)"
            raise FileError(first.path, f"{first.message}{more}", first.line)
        self.left_out.append(LeftOut(str(path), what, reason, len(rows), of, str(first)))

    def skip(self, path: str | Path, what: str, reason: str, count: int, of: int) -> None:
        """Count records that are left out because of what they are; any number of them may be."""
        if count:
            self.left_out.append(LeftOut(str(path), what, reason, count, of, reason, bad=False))

    def doubt(self, path: str | Path, message: str) -> None:
        """Say what is doubtful in a file, once."""
        text = f"{path}: {message}"
        if text not in self.doubts:
            self.doubts.append(text)

    def sentences(self) -> list[str]:
        """Return what to tell the user, a sentence for each."""
        return [str(one) for one in self.left_out] + self.doubts

    def described(self) -> dict[str, Any]:
        """Return all of it, ready for JSON."""
        return {"left_out": [vars(one) for one in self.left_out], "doubts": list(self.doubts)}

    def warn(self) -> None:
        """Give all of it as warnings of Python."""
        for sentence in self.sentences():
            warnings.warn(sentence, InputWarning, stacklevel=3)
