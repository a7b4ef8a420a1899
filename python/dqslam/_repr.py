"""Short texts for what there is, and how much of it."""


def counted(count: int, noun: str) -> str:
    """Return a number and what it counts, as in "1 box" and "2 boxes"."""
    ending = "" if count == 1 else "es" if noun.endswith(("s", "x")) else "s"
    return f"{count} {noun}{ending}"
