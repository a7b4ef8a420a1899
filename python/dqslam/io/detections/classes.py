"""Classes of boxes: their ids and names, and what to do where these contradict each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from dqslam._checks import Ints
from dqslam.io.files import FileError
from dqslam.io.formats import ReadContext
from dqslam.io.labels import LabelError, is_none, numbered

ONLY_CLASS = "object"  #: the name of the one class of boxes without classes
NO_CLASS = "unknown"  #: the name of the class of a box without one, where others have classes
MOST_LISTED = 5


def number_classes(
    path: str | Path,
    ids: Sequence[str] | None,
    names: Sequence[str] | None,
    table: dict[str, str],
    count: int,
    context: ReadContext,
    error: Callable[[int, str], FileError],
) -> tuple[Ints, tuple[str, ...]]:
    """Return the number of the class of each box, and its name.

    Parameters
    ----------
    path
        The file, for what is said about it.
    ids, names
        What each box has, (m,), or None. Ids that are no whole numbers are names, too.
    table
        Names by id, of the whole file.
    count
        The number of boxes, m.
    context
        Its ``classes`` are names by number and go before the file's.
    error
        Makes an error of a row and a message.
    """
    if ids is None and names is None:
        ids, table = ["0"] * count, {"0": ONLY_CLASS}
    labels = ids if ids is not None else names
    assert labels is not None
    try:
        class_id = numbered(labels, by_name=True)
    except LabelError as wrong:
        raise error(wrong.row, f"class_id is {wrong.label}, not a whole number") from None
    given = context.classes or {}
    class_name = []
    others: dict[int, str] = {}
    for row, (number, label) in enumerate(zip(class_id.tolist(), labels, strict=True)):
        own = table.get(label.strip(), "" if names is None else names[row])
        bare = NO_CLASS if is_none(label) else label.strip()
        class_name.append(given.get(number) or own or bare)
        if own and number in given and given[number] != own:
            others[number] = own
    for number, own in others.items():
        message = f"class {number} is {own} here, and is called {given[number]} as asked for"
        context.notes.doubt(path, message)
    if ids is not None:
        class_id = _apart(path, class_id, class_name, given, context)
    return class_id, tuple(class_name)


def _apart(
    path: str | Path,
    class_id: Ints,
    names: Sequence[str],
    given: dict[int, str],
    context: ReadContext,
) -> Ints:
    """Take the names for the classes where one id has several of them."""
    of_id: dict[int, list[str]] = {}
    of_name: dict[str, list[int]] = {}
    for number, name in dict.fromkeys(zip(class_id.tolist(), names, strict=True)):
        of_id.setdefault(number, []).append(name)
        of_name.setdefault(name, []).append(number)
    for number, several in of_id.items():
        if len(several) > 1 and number not in given:
            context.notes.doubt(
                path,
                f"class_id {number} has {len(several)} names ({_listed(several)}): "
                "the names are taken for the classes",
            )
            return numbered(names, by_name=True)
    for name, numbers in of_name.items():
        if len(numbers) > 1:
            context.notes.doubt(
                path,
                f"{len(numbers)} class_ids are named {name} ({_listed(list(map(str, numbers)))}): "
                "they are taken for classes of their own",
            )
    return class_id


def _listed(texts: Sequence[str]) -> str:
    more = ", ..." if len(texts) > MOST_LISTED else ""
    return ", ".join(texts[:MOST_LISTED]) + more
