"""The help of a command: the words that stand for the values of its options."""

import inspect
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

from typer.core import TyperCommand, TyperGroup

_WORDS: dict[Any, str] = {bool: "", Path: "PATH", str: "TEXT", int: "N", float: "NUMBER"}
_LONG = 25  # characters in a word that a narrow terminal would break; at spaces it may


class Command(TyperCommand):
    """A command whose help shows no type for switches, and the field's words for other types."""

    def __init__(self, name: str | None, **named: Any) -> None:
        super().__init__(name, **named)
        # The lines of a docstring end where those of the source do, not those of the terminal.
        paragraphs = inspect.cleandoc(self.help or "").split("\n\n")
        self.help = "\n\n".join(" ".join(one.split()) for one in paragraphs)

    def get_params(self, ctx: Any) -> Any:
        """Return the parameters, each with a word for its value."""
        assert self.callback is not None  # a command is made from its function
        return _worded(super().get_params(ctx), get_type_hints(inspect.unwrap(self.callback)))


class Group(TyperGroup):
    """All commands, with switches that are shown as those of a command."""

    def get_params(self, ctx: Any) -> Any:
        """Return the parameters, all of which are switches."""
        return _worded(super().get_params(ctx), {})


def _worded(parameters: Any, hints: dict[str, Any]) -> Any:
    for one in parameters:
        if one.param_type_name == "argument":
            one.display_type_rich = lambda ctx: ""  # its name says what it is
        elif one.metavar is None:
            one.metavar = "" if getattr(one, "is_flag", False) else _word(hints[one.name])
    return parameters


def _word(hint: Any) -> str:
    """Return the word for a value of a type; None, for an option that is not given, has none."""
    if get_origin(hint) is Literal:
        choices = "|".join(map(str, get_args(hint)))
        return choices if len(choices) < _LONG else choices.replace("|", " | ")
    if hint in _WORDS:
        return _WORDS[hint]
    (inner,) = (one for one in get_args(hint) if one is not type(None))
    return _word(inner)
