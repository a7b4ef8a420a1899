"""The command line: one module per command, combined here. It is the only part that prints.

The modules import heavy packages only inside functions, so that `dqslam --help` is fast.
"""

import os
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer

from dqslam._files import FileErrors
from dqslam._input import InputWarning
from dqslam._manifest import ChangedFileWarning
from dqslam._repr import printable
from dqslam._version import version
from dqslam.cli.ablation import ablation
from dqslam.cli.align import align
from dqslam.cli.batch import batch
from dqslam.cli.changes import changes
from dqslam.cli.convert import convert
from dqslam.cli.degeneracy import degeneracy
from dqslam.cli.demo import demo
from dqslam.cli.detect import detect
from dqslam.cli.evaluate import evaluate
from dqslam.cli.help import Command, Group
from dqslam.cli.inspect import inspect
from dqslam.cli.locate import locate
from dqslam.cli.merge import merge
from dqslam.cli.paper import paper
from dqslam.cli.plot import plot
from dqslam.cli.run import run
from dqslam.cli.shape import shape
from dqslam.cli.simulate import simulate
from dqslam.cli.sweep import sweep
from dqslam.cli.view import view
from dqslam.cli.worlds import worlds

# The commands in the order of the help, by the title of their panel.
COMMANDS: dict[str, tuple[Callable[..., None], ...]] = {
    "Start here": (demo, paper, simulate),
    "Your recording": (detect, inspect, convert, run, batch, evaluate, shape),
    "Places": (locate, changes, align, merge),
    "Look": (plot, view),
    "Study": (sweep, worlds, ablation, degeneracy),
}
EXIT_CODES = {
    0: "done",
    1: "a mistake in dqslam itself; its traceback is shown",
    2: "bad input: options, files, or a problem that they do not determine",
    3: "done, but the result of `run` is doubtful, `inspect --strict` has found a mistake, or "
    "maps do not say whether they are of one place, or how they lie to each other",
    4: "done, but a recording of `batch` has failed",
    130: "stopped by Ctrl-C",
    141: "stopped, because the reader of its output has gone",
}

app = typer.Typer(
    name="dqslam",
    cls=Group,
    epilog="Exit codes\n\n" + "\n".join(f"{code}: {why}" for code, why in EXIT_CODES.items()),
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)


def _say_version(asked: bool) -> None:
    if asked:
        typer.echo(f"dqslam {version() or '(not installed)'}")
        raise typer.Exit


@app.callback()
def _dqslam(
    _: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=_say_version, help="Print the version."),
    ] = False,
) -> None:
    """Object SLAM with dual quadrics: objects and trajectory from odometry and boxes."""


for _panel, _commands in COMMANDS.items():
    for _command in _commands:
        app.command(rich_help_panel=_panel, cls=Command)(_command)

_INTERRUPTED = 130
_BAD_INPUT = 2
_READER_GONE = 141  # as of a program that SIGPIPE ends
# UsageError, the base of BadParameter, has no public name in typer.
_UsageError: Any = typer.BadParameter.__mro__[1]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code, one of `EXIT_CODES`.

    Bad input gives one line on stderr, and a file of settings one line for each mistake. A mistake
    in dqslam itself keeps its traceback.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("always", ChangedFileWarning)
        warnings.simplefilter("always", InputWarning)
        warnings.showwarning = _show_warning
        return _run(arguments)


def _run(arguments: Sequence[str] | None) -> int:
    try:
        code = app(arguments, prog_name="dqslam", standalone_mode=False) or 0
        sys.stdout.flush()  # here, where an error can be caught
    except (BrokenPipeError, SystemExit):  # click's way to say the same
        _forget_output()
        code = _READER_GONE
    except (KeyboardInterrupt, typer.Abort):
        code = _INTERRUPTED
    except (_UsageError, ValueError, OSError, RuntimeError) as error:
        message = error.format_message() if isinstance(error, _UsageError) else str(error)
        for mistake in message.splitlines() if isinstance(error, FileErrors) else [message]:
            if mistake:  # a bare `dqslam` has already shown its help
                _say(mistake)
        code = _BAD_INPUT
    if code == _INTERRUPTED:
        _say("stopped")
    return int(code)


def _forget_output() -> None:
    """Let the rest of the output go nowhere, so that the interpreter's last flush is quiet."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Show a warning as one line for the user, without the place in the source."""
    print("warning:", _in_a_line(str(message)), file=sys.stderr)  # noqa: T201


def _say(message: str) -> None:
    print("dqslam:", _in_a_line(message), file=sys.stderr)  # noqa: T201


def _in_a_line(text: str) -> str:
    return printable(" ".join(text.split()))
