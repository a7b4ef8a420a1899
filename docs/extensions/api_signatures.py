"""Signatures and attributes of the API reference, as a reader wants them.

pybind11 writes what a caller may pass in full: ``typing.Annotated[numpy.typing.ArrayLike,
numpy.float64, "[m, n]"]``. The shapes that matter are in the docstrings, with names and units.
Napoleon takes an attribute's "Meters: of the center" for a type and its explanation; it is a text.
"""

import re

from docutils import nodes
from numpy.typing import ArrayLike
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.typing import stringify_annotation

_SHORTER = [
    (r"typing\.Annotated\[numpy\.typing\.(ArrayLike|NDArray\[numpy\.\w+\])[^\]]*\]\"\]", r"\1"),
    (r"typing\.Annotated\[numpy\.typing\.ArrayLike, numpy\.(\w+), \"[^\"]*\"\]", r"ArrayLike"),
    (r"NDArray\[numpy\.\w+\]", "ndarray"),
    (r"typing\.SupportsFloat \| typing\.SupportsIndex", "float"),
    (r"typing\.SupportsInt \| typing\.SupportsIndex", "int"),
    (r"collections\.abc\.Sequence", "Sequence"),
    (r"array\(\[\](, \w+=[^)]*(\(0, \d\)[^)]*)?)?\)", "[]"),
    (r"array\(\[([^\]]*)\]\)", r"[\1]"),
    (
        r"~?(numpy\.)?ndarray\[tuple\[~?(typing\.)?Any, \.\.\.\], "
        r"~?(numpy\.)?dtype\[~?(numpy\.)?(\w+)\]\]",
        r"NDArray[\5]",
    ),
    (re.escape(stringify_annotation(ArrayLike, "smart")), "ArrayLike"),
    (r"<factory>", "..."),
    (r"self: dqslam\._core\.\w+(, )?", ""),
]


def _shorten(
    app: Sphinx,
    what: str,
    name: str,
    obj: object,
    options: object,
    signature: str | None,
    returns: str | None,
) -> tuple[str | None, str | None] | None:
    if hasattr(obj, "model_fields"):
        return "(**settings)", None  # those of a file, which the page shows
    return _short(signature), _short(returns)


def _shorten_types(app: Sphinx, domain: str, kind: str, content: addnodes.desc_content) -> None:
    """Shorten the types of attributes, which autodoc writes past the event above."""
    for annotation in content.parent.findall(addnodes.desc_annotation):
        if "dtype" not in annotation.astext():
            continue
        # A reference holds its name twice: in full, and what is shown where it is resolved.
        for condition in list(annotation.findall(addnodes.pending_xref_condition)):
            if condition["condition"] == "resolved":
                condition.parent.remove(condition)
        text = annotation.astext()
        annotation.clear()
        annotation += nodes.Text(_short(text))


def _short(text: str | None) -> str | None:
    if text is None:
        return None
    for long, short in _SHORTER:
        text = re.sub(long, short, text)
    return text


_ATTRIBUTES = ("attribute", "property", "data")
_kept: dict[str, list[str]] = {}


def _keep(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Remember an attribute's docstring before Napoleon reads it."""
    if what in _ATTRIBUTES:
        _kept[name] = list(lines)


def _restore(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Give an attribute its docstring back; |x| is an absolute value, not a substitution."""
    if what in _ATTRIBUTES:
        lines[:] = [line.replace("|", r"\|") for line in _kept.pop(name)]


def setup(app: Sphinx) -> dict[str, bool]:
    """Shorten signatures after autodoc has found them; step around Napoleon (priority 500)."""
    app.connect("autodoc-process-docstring", _keep, priority=400)
    app.connect("autodoc-process-docstring", _restore, priority=600)
    app.connect("autodoc-process-signature", _shorten)
    app.connect("object-description-transform", _shorten_types)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
