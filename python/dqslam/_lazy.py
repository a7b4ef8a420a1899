"""Public names that are imported when they are first asked for (PEP 562)."""

from collections.abc import Callable


def lazy_exports(
    package: str, source: str
) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package.

    Its public names are those of the lines ``from MODULE import NAME as NAME`` in its ``source``,
    the file that type checkers read them from. What is imported from the package itself is a
    submodule, which is no part of ``__all__``: ``from package import *`` would hide namesakes.
    """
    with open(source, encoding="utf-8") as lines:
        words = [line.split() for line in lines]
    homes = {line[3]: line[1] for line in words if line[::2] == ["from", "import", "as"]}

    def get(name: str) -> object:
        from importlib import import_module
        from sys import modules

        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if homes[name] == package:
            return import_module(f"{package}.{name}")
        value = getattr(import_module(homes[name]), name)
        setattr(modules[package], name, value)  # found without this function from now on
        return value

    return get, lambda: sorted(homes), sorted(name for name in homes if homes[name] != package)
