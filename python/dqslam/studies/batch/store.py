"""The folder of a batch: results and a record of each recording, from which a batch is resumed.

DIR/recordings/NAME/  the results, as ``dqslam run`` writes them
DIR/runs/NAME.toml    the options, for ``dqslam run --config``
DIR/runs/NAME.json    the record
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from dqslam._manifest import NAME, digest, manifest_or_none
from dqslam._version import version
from dqslam.io.files import FileError, write_json

_RUN = "dqslam run"


@dataclass(frozen=True)
class Record:
    """What is known of the last run of a recording. It is written before the run and after it."""

    SUCCESS: ClassVar[tuple[int, ...]] = (0, 3)
    """Exit codes of runs that have written results."""

    name: str
    version: str | None
    settings: dict[str, Any]
    files: dict[str, list[int]]
    """Number of files, bytes, and last change [ns] of each file and folder that is read."""
    replaces: str | None
    """SHA-256 of the manifest of the results that were there before."""
    exit_code: int | None = None
    """None if the run has not ended, or nobody was left to write how."""
    seconds: float | None = None
    error: str | None = None


class Store:
    """Results and records in a folder, which all workers reach.

    Parameters
    ----------
    folder
        Made if it is missing.

    Raises
    ------
    FileError
        If the folder cannot be made.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(os.path.abspath(folder))
        try:
            for name in ("recordings", "runs"):
                (self.folder / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(folder, f"cannot be written: {error.strerror}") from None

    def results(self, name: str) -> Path:
        """Return the folder of the results of a recording."""
        return self.folder / "recordings" / name

    def config(self, name: str) -> Path:
        """Return the file of the options of a recording."""
        return self.folder / "runs" / f"{name}.toml"

    def begin(self, name: str, settings: Mapping[str, Any], files: Sequence[Path]) -> Record:
        """Write and return the record of a run that begins now."""
        record = Record(name, version(), dict(settings), _state(files), self._manifest(name))
        self._write(record)
        return record

    def end(self, record: Record, *, exit_code: int, seconds: float, error: str | None) -> None:
        """Write the record of a run that has ended."""
        self._write(replace(record, exit_code=exit_code, seconds=seconds, error=error))

    def finished(
        self, name: str, settings: Mapping[str, Any], files: Sequence[Path]
    ) -> Record | None:
        """Return the record of a recording that need not be run; None for any other.

        It has complete results, of this version, of the same options, and of files that have not
        changed. A run whose end nobody could record counts if it has replaced the results.
        """
        record = self.record(name)
        if record is None or (record.version, record.settings) != (version(), dict(settings)):
            return None
        manifest = manifest_or_none(self.results(name))
        if manifest is None or manifest.written_by != _RUN or not manifest.complete:
            return None
        if record.files != _state(files):
            return None
        if record.exit_code in Record.SUCCESS:
            return record
        unrecorded = record.exit_code is None and self._manifest(name) != record.replaces
        return record if unrecorded else None

    def record(self, name: str) -> Record | None:
        """Return the record of a recording; None if there is none, or only a torn one."""
        try:
            return Record(**json.loads(self._record(name).read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return None

    def report(self, name: str) -> dict[str, Any]:
        """Return the report of a recording with results."""
        report: dict[str, Any] = json.loads((self.results(name) / "report.json").read_text("utf-8"))
        return report

    def _record(self, name: str) -> Path:
        return self.folder / "runs" / f"{name}.json"

    def _write(self, record: Record) -> None:
        write_json(self._record(record.name), asdict(record))

    def _manifest(self, name: str) -> str | None:
        path = self.results(name) / NAME
        return digest(path) if path.is_file() else None


def _state(files: Sequence[Path]) -> dict[str, list[int]]:
    """Return number, bytes and last change of files; a missing one has none."""
    return {os.path.abspath(path): _state_of(path) for path in files}


def _state_of(path: Path) -> list[int]:
    inside = [path] if not path.is_dir() else [one for one in path.rglob("*") if one.is_file()]
    found = [one.stat() for one in inside if one.exists()]
    latest = max((one.st_mtime_ns for one in found), default=0)
    return [len(found), sum(one.st_size for one in found), latest]
