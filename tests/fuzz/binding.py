"""Functions of the extension with arguments of any shape: an error, never a crash."""

import contextlib
import random
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from dqslam import _core

ODD = (0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, 1e308, 1e-308, 1e100, 1e6, 0.5, 640.0)
SIZES = (0, 1, 2, 3, 4, 6, 7, 9, 16, 36, 81)
# Who asks for two billion points of an outline is told that there is no room for them.
ERRORS = (ValueError, TypeError, RuntimeError, IndexError, MemoryError)
ARGUMENT = re.compile(r"(\w+): ([^,()]+(?:\[[^\]]*\])?)")


def functions() -> list[str]:
    """Return the names of the extension's functions and classes."""
    return sorted(
        name
        for name in dir(_core)
        if not name.startswith("_") and callable(getattr(_core, name)) and _is_tried(name)
    )


def _is_tried(name: str) -> bool:
    kind = getattr(_core, name)
    return not (isinstance(kind, type) and issubclass(kind, BaseException))


def _signature(function: Any) -> list[tuple[str, str]]:
    text = (function.__init__ if isinstance(function, type) else function).__doc__ or ""
    line = next((one for one in text.splitlines() if "(" in one and ":" in one), "")
    return [pair for pair in ARGUMENT.findall(line) if pair[0] != "self"]


def _array(rng: random.Random) -> Any:
    shape = rng.choice(((), (rng.choice(SIZES),), (rng.choice(SIZES[:6]), rng.choice(SIZES))))
    size = int(np.prod(shape))
    if rng.random() < 0.6:
        values = [rng.uniform(-2.0, 2.0) for _ in range(size)]
        if values and rng.random() < 0.4:
            values[rng.randrange(size)] = rng.choice(ODD)
    else:
        values = [rng.choice(ODD) for _ in range(size)]
    array = np.array(values).reshape(shape)
    return np.asfortranarray(array) if rng.random() < 0.2 else array


def _whole(rng: random.Random) -> Any:
    numbers = (0, 1, 2, -1, -2, 7, 2**31 - 1, -(2**31), 2**31, 2**63)
    count = rng.choice(SIZES[:6])
    return rng.choice(
        (rng.choice(numbers), np.array([rng.choice(numbers[:8]) for _ in range(count)]))
    )


def _camera(rng: random.Random) -> Any:
    lens = [rng.choice((0.0, 0.1, -0.3, 1e3)) for _ in range(5)]
    return _core.Camera(500.0, 500.0, 320.0, 240.0, 640, 480, distortion=lens)


def _value(rng: random.Random, kind: str) -> Any:
    makers: dict[str, Callable[[random.Random], Any]] = {
        "Camera": _camera,
        "PoseModel": lambda rng: rng.choice((_core.PoseModel.SE2, _core.PoseModel.SE3)),
        "SolveOptions": lambda rng: _core.SolveOptions(),
        "int": _whole,
    }
    for name, maker in makers.items():
        if name in kind and rng.random() < 0.95:
            return maker(rng)
    return rng.choice((_array, _array, _array, _whole, lambda rng: None))(rng)


def try_binding(name: str, seed: str) -> None:
    """Call a function of the extension with arguments from a seed; it may refuse them."""
    rng, function = random.Random(seed), getattr(_core, name)
    given = {key: _value(rng, kind) for key, kind in _signature(function)}
    with contextlib.suppress(*ERRORS):
        function(**given)
