"""One thread at a time in the methods of an object."""

from __future__ import annotations

import functools
from collections.abc import Callable
from threading import RLock
from typing import Concatenate, ParamSpec, Protocol, TypeVar


class HasLock(Protocol):
    """An object with a lock of its own."""

    _lock: RLock


Owner = TypeVar("Owner", bound=HasLock)
Given = ParamSpec("Given")
Found = TypeVar("Found")


def locked(
    method: Callable[Concatenate[Owner, Given], Found],
) -> Callable[Concatenate[Owner, Given], Found]:
    """Let a method wait until no other thread is in a method of the same object."""

    @functools.wraps(method)
    def call(owner: Owner, /, *arguments: Given.args, **named: Given.kwargs) -> Found:
        with owner._lock:
            return method(owner, *arguments, **named)

    return call
