"""Signatures of the compiled core, short enough to read.

pybind11 writes what a caller may pass in full: ``typing.Annotated[numpy.typing.ArrayLike,
numpy.float64, "[m, n]"]``. The shapes that matter are in the docstrings, with names and units.
"""

import re

from sphinx.application import Sphinx

_SHORTER = [
    (r"typing\.Annotated\[numpy\.typing\.(ArrayLike|NDArray\[numpy\.\w+\])[^\]]*\]\"\]", r"\1"),
    (r"typing\.Annotated\[numpy\.typing\.ArrayLike, numpy\.(\w+), \"[^\"]*\"\]", r"ArrayLike"),
    (r"NDArray\[numpy\.\w+\]", "ndarray"),
    (r"typing\.SupportsFloat \| typing\.SupportsIndex", "float"),
    (r"typing\.SupportsInt \| typing\.SupportsIndex", "int"),
    (r"collections\.abc\.Sequence", "Sequence"),
    (r"array\(\[\](, \w+=[^)]*(\(0, \d\)[^)]*)?)?\)", "[]"),
    (r"array\(\[([^\]]*)\]\)", r"[\1]"),
    (r"<dqslam\._core\.(\w+) object at \w+>", r"\1()"),
    (r"self: dqslam\._core\.\w+(, )?", ""),
    (r"dqslam\._core\.", ""),
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
    if not name.startswith("dqslam._core."):
        return None
    return _short(signature), _short(returns)


def _short(text: str | None) -> str | None:
    if text is None:
        return None
    for long, short in _SHORTER:
        text = re.sub(long, short, text)
    return text


def setup(app: Sphinx) -> dict[str, bool]:
    """Shorten signatures after autodoc has found them."""
    app.connect("autodoc-process-signature", _shorten)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
