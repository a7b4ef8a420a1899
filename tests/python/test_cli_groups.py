"""Options that several commands have together, as fields of a dataclass."""

from dataclasses import dataclass, fields
from typing import Annotated

import typer
from typer.testing import CliRunner

from dqslam.cli import COMMANDS
from dqslam.cli.groups import with_groups
from dqslam.cli.reading import ReadingOptions, RecordingOptions


@dataclass(frozen=True, kw_only=True)
class Light:
    brightness: Annotated[int, typer.Option(min=1)] = 3
    lamp: Annotated[str, typer.Option(help="Which one.")]
    colors: Annotated[list[str] | None, typer.Option("--color")] = None


def command(taken):
    program = typer.Typer()

    @program.command()
    @with_groups
    def shine(light: Light, seconds: Annotated[float, typer.Option()] = 0.5) -> None:
        """Shine."""
        taken.append((light, seconds))

    return program


def test_fields_are_options_with_their_names_bounds_and_defaults():
    taken = []
    program = command(taken)
    call = lambda *arguments: CliRunner().invoke(program, arguments).exit_code  # noqa: E731
    assert call("--lamp", "left") == 0
    assert call("--lamp", "right", "--brightness", "7", "--color", "red", "--color", "blue") == 0
    assert taken[0] == (Light(lamp="left"), 0.5)
    assert taken[1] == (Light(lamp="right", brightness=7, colors=["red", "blue"]), 0.5)
    assert call() == 2  # a field without a default is needed
    assert call("--lamp", "left", "--brightness", "0") == 2
    assert len(taken) == 2


def test_each_command_that_reads_a_recording_has_each_option_of_reading():
    by_name = {one.__name__: one for group in COMMANDS.values() for one in group}
    one_file = {field.name for field in fields(ReadingOptions)}
    all_files = {field.name for field in fields(RecordingOptions)}
    assert {"max_bad", "letterbox", "time_scale", "camera_in_body"} <= one_file < all_files
    for name, options in (("run", all_files), ("inspect", all_files), ("convert", one_file)):
        assert options <= set(by_name[name].__annotations__)
