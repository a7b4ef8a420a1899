"""The file of a batch: recordings and their options, which are those of ``dqslam run``."""

from __future__ import annotations

import glob
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

from dqslam._files import FileError, FileErrors
from dqslam.cli.run import run
from dqslam.cli.settings import path_settings, setting_types

if TYPE_CHECKING:
    from pydantic import BaseModel

    from dqslam.config import TomlFile
    from dqslam.studies.batch import AlignOptions, MergeOptions, Task

# The batch chooses where results are. A bag is camera, odometry and boxes in one file.
_CHOSEN = ("out", "mcap", "foxglove", "host", "port")
_IN_BAG = ("camera", "odometry", "detections")
_PLACES = ("folder", "bag", "name")


@dataclass(frozen=True)
class Batch:
    """Recordings with their options, and what is done with their maps."""

    tasks: tuple[Task, ...]
    align: AlignOptions | None
    merge: MergeOptions | None


def load_batch(path: str | Path) -> Batch:
    """Read the file of a batch.

    A path among the options is one in the folder of the recording or, if that has no such file, in
    the folder of the batch's file.

    Raises
    ------
    FileError
        If the file is missing or not TOML. ``FileErrors`` lists all mistakes with their lines:
        unknown options and values, folders that do not exist, names that are used twice.
    """
    from dqslam.config import check_model, read_toml
    from dqslam.studies.batch import AlignOptions, MergeOptions, Task

    file = read_toml(path)
    mistakes: list[FileError] = []
    try:
        check_model(_model(), file.content, file)
    except FileErrors as error:
        mistakes += error.errors
    defaults = _table(file.content.get("defaults"))
    entries = file.content.get("recordings")
    found: dict[str, dict[str, Any]] = {}
    for number, entry in enumerate(entries if isinstance(entries, list) else []):
        location = ("recordings", number)
        for name, place in _places(file, _table(entry), location, mistakes):
            if name in found:
                mistakes.append(file.error(location, f"another recording has the name {name}, too"))
            settings = _settings(file, place, defaults, _table(entry))
            for missing in [one for one in _IN_BAG if one not in settings]:
                mistakes.append(
                    file.error(location, f"{missing} is missing, here and in [defaults]")
                )
            found[name] = settings
    if entries == []:
        mistakes.append(file.error(("recordings",), "recordings: there is none"))
    if mistakes:  # a recording of a glob repeats the mistakes of its entry
        raise FileErrors(list({str(one): one for one in mistakes}.values()))
    align, merge = file.content.get("align"), file.content.get("merge")
    return Batch(
        tuple(Task(name, settings) for name, settings in found.items()),
        None if align is None else AlignOptions(**align),
        None if merge is None else MergeOptions(**merge),
    )


@cache
def _run_command() -> Any:
    alone = typer.Typer(add_completion=False)
    alone.command()(run)
    return typer.main.get_command(alone)


def _model() -> type[BaseModel]:
    """Make the model of the whole file."""
    from pydantic import ConfigDict, Field, create_model

    config = ConfigDict(extra="forbid", strict=True)
    types = {key: kind for key, kind in setting_types(_run_command()).items() if key not in _CHOSEN}
    # Fields have aliases, because not every name is allowed for a field of a model.
    options: dict[str, Any] = {
        f"setting_{key}": (kind | None, Field(None, alias=key)) for key, kind in types.items()
    }
    places: dict[str, Any] = dict.fromkeys(_PLACES, (str | None, None))
    combining: dict[str, Any] = {
        "motion": (Literal["auto", "se2", "se3"], "auto"),
        "sigma": (float | None, Field(None, gt=0.0)),
    }
    combine = create_model("Combine", __config__=config, **combining)
    top: dict[str, Any] = {
        "defaults": (create_model("Defaults", __config__=config, **options) | None, None),
        "recordings": (list[create_model("Entry", __config__=config, **options, **places)], ...),  # type: ignore[misc]
        "align": (combine | None, None),
        "merge": (combine | None, None),
    }
    return create_model("Batch", __config__=config, **top)


def _table(content: Any) -> Mapping[str, Any]:
    """Return a table of the file; of a mistake that was reported before, an empty one."""
    return content if isinstance(content, Mapping) else {}


def _places(
    file: TomlFile, entry: Mapping[str, Any], location: tuple[str | int, ...], mistakes: list[Any]
) -> Iterator[tuple[str, Path]]:
    """Yield the recordings of an entry: their names, and their folders or bags."""
    keys = [key for key in ("folder", "bag") if isinstance(entry.get(key), str)]
    if len(keys) != 1:
        message = "expected one of folder and bag" if not keys else "folder and bag: choose one"
        mistakes.append(file.error(location, message))
        return
    key, pattern = keys[0], Path(entry[keys[0]]).expanduser()
    base = file.path.parent
    is_pattern = glob.has_magic(str(pattern))
    found = sorted(glob.glob(str(base / pattern))) if is_pattern else [str(base / pattern)]
    places = [Path(one) for one in found]
    places = [one for one in places if (one.is_dir() if key == "folder" else one.exists())]
    if not places:
        missing = "nothing fits" if is_pattern else "there is no such"
        mistakes.append(file.error((*location, key), f"{key}: {missing} {key} {pattern}"))
    name = entry.get("name")
    if isinstance(name, str) and len(places) > 1:
        message = f"name: {pattern} is {len(places)} recordings, which need names of their own"
        mistakes.append(file.error((*location, "name"), message))
    elif isinstance(name, str) and (Path(name).name != name or name.startswith(".")):
        message = f"name: {name!r} is not a name that a folder may have"
        mistakes.append(file.error((*location, "name"), message))
    else:
        for place in places:
            yield name or _name(base / pattern, place, is_pattern), place


def _name(pattern: Path, place: Path, is_pattern: bool) -> str:
    """Return the name of a place: its last part, and with a pattern all from its first * on."""
    if not is_pattern:
        return place.resolve().name
    first = next(row for row, part in enumerate(pattern.parts) if glob.has_magic(part))
    return "_".join(place.parts[first:]).lstrip(".")


def _settings(
    file: TomlFile, place: Path, defaults: Mapping[str, Any], entry: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the options of a recording in a folder or bag."""
    settings = dict(defaults)
    folder = place if place.is_dir() else place.parent
    if "bag" in entry:
        settings |= dict.fromkeys(_IN_BAG, str(place.absolute()))
    settings |= {key: value for key, value in entry.items() if key not in _PLACES}
    paths = path_settings(_run_command())
    for key, value in settings.items():
        if key in paths and isinstance(value, str):
            path = Path(value).expanduser()
            beside = file.path.parent / path
            own = folder / path
            settings[key] = (beside if beside.exists() and not own.exists() else own).absolute()
    return settings
