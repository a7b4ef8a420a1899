"""Options from a file (``--config``), and the used options written to a file (config.toml).

The keys are the names of the options, with underscores. An option on the command line overrides the
file, and the file overrides the default.
"""

from __future__ import annotations

import inspect
import types
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import typer

from dqslam._files import write_text
from dqslam._version import version

if TYPE_CHECKING:
    from pydantic import BaseModel

CONFIG = "config.toml"
# These options change only what is shown.
_NOT_SETTINGS = ("help", "config", "quiet", "json")


def _read(context: typer.Context, path: Path | None) -> Path | None:
    """Replace the defaults of options by the settings of a file."""
    if path is None or context.resilient_parsing:
        return path
    from dqslam.config import load_toml_model

    settings = load_toml_model(path, settings_model(context.command)).model_dump(
        by_alias=True, exclude_unset=True
    )
    parameters = setting_names(context.command)
    context.default_map = {
        parameters[key]: value for key, value in settings.items() if key in parameters
    }
    return path


ConfigFile = Annotated[
    Path | None,
    typer.Option(
        "--config",
        metavar="FILE",
        is_eager=True,
        callback=_read,
        help="TOML file of options, like config.toml of a result. The command line overrides it.",
    ),
]


def save_settings(context: typer.Context, path: Path) -> None:
    """Write all options as they are in force to a file for `--config`."""
    write_text(path, settings_text(context))


def settings_text(context: typer.Context) -> str:
    """Return all options as they are in force, as TOML for `--config`.

    Unset options are left out, because their defaults may depend on the machine or the files.
    """
    from dqslam.config import toml_text

    settings: dict[str, Any] = {"command": context.info_name, "dqslam_version": version()}
    for key, name in setting_names(context.command).items():
        settings[key] = _plain(context.params[name])
    return toml_text(settings)


def setting_names(command: Any) -> dict[str, str]:
    """Return the parameters of a command by their names in a file."""
    names = {}
    for parameter in command.params:
        long = [name for name in parameter.opts if name.startswith("--")]
        key = long[0].removeprefix("--").replace("-", "_") if long else parameter.name
        if key not in _NOT_SETTINGS:
            names[key] = parameter.name
    return names


def settings_model(command: Any) -> type[BaseModel]:
    """Make the model of the settings that a command can read from a file."""
    from pydantic import ConfigDict, Field, create_model

    keys = setting_types(command) | {"command": Literal[command.name], "dqslam_version": str}
    # Fields have aliases, because not every name is allowed for a field of a model.
    fields: dict[str, Any] = {
        f"setting_{key}": (type_ | None, Field(None, alias=key)) for key, type_ in keys.items()
    }
    config = ConfigDict(extra="forbid", strict=True)
    return create_model("Settings", __config__=config, **fields)


def setting_types(command: Any) -> dict[str, Any]:
    """Return the types that the options of a command have in a file, by their names in it."""
    return {key: _setting_type(one) for key, one in _annotations(command).items()}


def path_settings(command: Any) -> tuple[str, ...]:
    """Return the names, in a file, of the options of a command that are paths."""
    return tuple(key for key, one in _annotations(command).items() if _is_path(one))


def _annotations(command: Any) -> dict[str, Any]:
    found = get_type_hints(inspect.unwrap(command.callback), include_extras=True)
    return {key: found[name] for key, name in setting_names(command).items()}


def _is_path(annotation: Any) -> bool:
    return annotation is Path or any(_is_path(one) for one in get_args(annotation))


def _setting_type(annotation: Any) -> Any:
    """Turn the annotation of an option into its type in a file, with its bounds."""
    from pydantic import Field

    if get_origin(annotation) is Annotated:
        inner, option, *_ = get_args(annotation)
        bounds = Field(ge=getattr(option, "min", None), le=getattr(option, "max", None))
        found = _setting_type(inner)
        return Annotated[found, bounds] if found in (int, float) else found
    if get_origin(annotation) in (Union, types.UnionType):
        (inner,) = (one for one in get_args(annotation) if one is not type(None))
        return _setting_type(inner)
    if get_origin(annotation) is list:
        return list[_setting_type(get_args(annotation)[0])]  # type: ignore[misc]
    return str if annotation is Path else annotation


def _plain(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value] or None
    return str(value) if isinstance(value, Path) else value
