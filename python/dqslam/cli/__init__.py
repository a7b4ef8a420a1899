"""The command line: a module per command, put together here; the only part that prints."""

import sys
from collections.abc import Sequence
from typing import Any

import typer

from dqslam.cli.ablation import ablation
from dqslam.cli.convert import convert
from dqslam.cli.degeneracy import degeneracy
from dqslam.cli.evaluate import evaluate
from dqslam.cli.inspect import inspect
from dqslam.cli.paper import paper
from dqslam.cli.run import run

app = typer.Typer(
    name="dqslam",
    help="Object SLAM with dual quadrics.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
app.command()(paper)
app.command()(run)
app.command()(evaluate)
app.command()(inspect)
app.command()(convert)
app.command()(degeneracy)
app.command()(ablation)

_INTERRUPTED = 130
_BAD_INPUT = 2
# UsageError has no public name in typer; it is what BadParameter derives from.
_UsageError: Any = typer.BadParameter.__mro__[1]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return the exit code: 0 done, 2 bad input, 130 stopped by Ctrl-C.

    Bad input is one line on stderr; an error that is ours keeps its traceback.
    """
    try:
        code = app(arguments, prog_name="dqslam", standalone_mode=False) or 0
    except (KeyboardInterrupt, typer.Abort):
        code = _INTERRUPTED
    except (_UsageError, ValueError, OSError, RuntimeError) as error:
        message = error.format_message() if isinstance(error, _UsageError) else str(error)
        if message:  # a bare `dqslam` has shown its help already
            _say(message)
        code = _BAD_INPUT
    if code == _INTERRUPTED:
        _say("stopped")
    return int(code)


def _say(message: str) -> None:
    print("dqslam:", " ".join(message.split()), file=sys.stderr)  # noqa: T201
