"""The directory of a sweep: one file per finished trial, from which a sweep is resumed.

DIR/cells/KEY.json        all settings of a cell
DIR/trials/KEY_SEED.json  the result of one trial of the cell
"""

import json
from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path

from dqslam._version import version
from dqslam.io.files import FileError, write_json
from dqslam.studies.sweep.settings import TrialSettings
from dqslam.studies.sweep.trial import TrialResult


class Store:
    """Finished trials in a directory.

    A trial depends only on the parts of its file name. Writing it again writes the same content.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        try:
            for name in ("cells", "trials"):
                (self.folder / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(folder, f"cannot be written: {error.strerror}") from None

    def describe_cell(self, key: str, settings: TrialSettings) -> None:
        """Write the settings of a cell, unless the file exists."""
        path = self.folder / "cells" / f"{key}.json"
        if not path.exists():
            write_json(path, {"scenario_name": settings.scenario.name} | settings.in_full())

    def save(self, result: TrialResult) -> None:
        """Write a finished trial."""
        write_json(self._path(result.key), asdict(result))

    def finished(self, keys: Collection[str]) -> dict[str, TrialResult]:
        """Return those of some trials that are finished; a trial that cannot be read is not.

        Raises
        ------
        FileError
            If one is of another version of dqslam, because versions must not be mixed.
        """
        here = {path.stem for path in (self.folder / "trials").glob("*.json")}
        found = {}
        for key in keys:
            result = _read(self._path(key)) if key in here else None
            if result is None:
                continue
            if result.version != version():
                message = f"is of dqslam {result.version}, not {version()}: start anew elsewhere"
                raise FileError(self._path(key), message)
            found[key] = result
        return found

    def _path(self, key: str) -> Path:
        return self.folder / "trials" / f"{key}.json"


def _read(path: Path) -> TrialResult | None:
    """Read a trial; return None for a file that a crash of the machine left empty."""
    try:
        return TrialResult(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None
