"""Scenarios from TOML files, by name or path."""

from pathlib import Path
from typing import Any

from dqslam.config import TomlFile, check_model, read_toml
from dqslam.simulation.scenario.scenario import Scenario


def load_scenario(source: str | Path) -> Scenario:
    """Read a scenario from a TOML file, or by the bare name of one that comes with dqslam.

    A file with `base = "NAME"` only needs the settings that differ from that scenario. A section
    of another `kind` than the base's replaces it whole.

    Raises
    ------
    FileNotFoundError
        If there is no such file; the error lists the names that come with dqslam.
    FileError
        When the file is no scenario; names the file, and the line of every wrong setting.

    Examples
    --------
    >>> import dqslam as dq
    >>> scenario = dq.load_scenario("paper")
    >>> scenario.world.object_count, scenario.odometry.rotation_sigma_rad
    (10, 0.02)
    """
    path = _find(source)
    file = read_toml(path)
    settings = _with_base(file) if "base" in file.content else file.content
    return check_model(Scenario, {"name": path.stem} | settings, file)


def _with_base(file: TomlFile) -> dict[str, Any]:
    """Return the settings of the base of a file, with the changes of the file."""
    base = file.content["base"]
    if not isinstance(base, str):
        raise file.error(("base",), f"base: expected the name of a scenario, not {base!r}")
    settings = read_toml(_find(base)).content
    if "base" in settings:
        raise file.error(("base",), f"base: {base} is not whole, but has a base itself")
    return _merged(
        settings, {name: value for name, value in file.content.items() if name != "base"}
    )


def _merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Replace settings, section by section."""
    result = base | changes
    for name in base.keys() & changes.keys():
        old, new = base[name], changes[name]
        if isinstance(old, dict) and isinstance(new, dict) and not _is_other_kind(old, new):
            result[name] = old | new
    return result


def _is_other_kind(base: dict[str, Any], changes: dict[str, Any]) -> bool:
    return "kind" in changes and changes["kind"] != base.get("kind")


def _folders(part: str) -> list[Path]:
    """Return folders of named scenarios, in the installed package or in a checkout."""
    here = Path(__file__).resolve()
    return [root / "data" / "scenarios" / part for root in (here.parents[2], here.parents[4])]


_WHOLE, _WORLDS = _folders(""), _folders("worlds")


def _find(source: str | Path) -> Path:
    path = Path(source)
    if path.is_file():
        return path
    if path.name == str(source) and not path.suffix:
        for folder in (*_WHOLE, *_WORLDS):
            if (folder / f"{source}.toml").is_file():
                return folder / f"{source}.toml"
    names = [
        ", ".join(sorted({file.stem for folder in folders for file in folder.glob("*.toml")}))
        for folders in (_WHOLE, _WORLDS)
    ]
    raise FileNotFoundError(
        f"{source}: no such scenario; by name there are: {names[0]}; and worlds: {names[1]}"
    )
