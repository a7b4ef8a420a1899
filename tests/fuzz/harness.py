"""Cases one after another in a process of their own, which may crash or hang."""

import contextlib
import mmap
import os
import resource
import select
import signal
import struct
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

from dqslam._manifest import ChangedFileWarning
from fuzz.binding import functions, try_binding
from fuzz.readers import readers, try_reader
from fuzz.sessions import try_session

LONGEST_CASE_S = 60.0

Targets = Mapping[str, Callable[[str], None]]


@contextlib.contextmanager
def targets(begin: str = "") -> Iterator[Targets]:
    """Give what is fuzzed, by names: functions that try the case of a seed."""
    with tempfile.TemporaryDirectory(prefix="dqslam-fuzz-") as place:
        good, copies = Path(place) / "good", Path(place) / "copies"
        good.mkdir()
        copies.mkdir()
        found: dict[str, Callable[[str], None]] = {}
        for reader in readers(good):
            found[f"reader {reader.name}"] = partial(try_reader, reader, folder=copies)
        for name in functions():
            found[f"binding {name}"] = partial(try_binding, name)
        for number in range(4):  # a session is much slower than a file
            found[f"session {number}"] = try_session
        yield {name: one for name, one in found.items() if name.startswith(begin)}


class Harness:
    """Runs cases until a time, and says what fails; each kind of failure once.

    Parameters
    ----------
    found
        What is fuzzed.
    seed
        The same seed gives the same cases.
    memory_gb
        A case that needs more fails; 0 for no limit, as under a sanitizer.
    """

    def __init__(self, found: Targets, seed: str, *, memory_gb: float) -> None:
        self._targets = list(found.items())
        is_sanitized = "san.so" in os.environ.get("LD_PRELOAD", "")  # which maps terabytes
        self._seed, self._memory = seed, 0 if is_sanitized else int(memory_gb * 2**30)
        self._current = mmap.mmap(-1, 8)
        self._kinds: set[str] = set()
        self.done = 0

    def case(self, number: int) -> tuple[str, Callable[[str], None]]:
        """Return the name of a case, from which it can be repeated, and its target."""
        name, work = self._targets[number % len(self._targets)]
        return f"{name}@{self._seed}:{number}", work

    def run(self, seconds: float, say: Callable[[str], None], cases: int = 2**62) -> int:
        """Run cases for some time, and not more than some; return the number of failures."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and self.done < cases:
            self._run_child(end, say, cases)
        return len(self._kinds)

    def _run_child(self, end: float, say: Callable[[str], None], cases: int) -> None:
        """Run cases in a child until the end, or until one ends the child."""
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            code = 1
            try:
                os.close(reading)
                with os.fdopen(writing, "w") as told:
                    self._work(end, cases, lambda text: print(text, file=told, flush=True))
                code = 0
            finally:
                os._exit(code)
        os.close(writing)
        with os.fdopen(reading) as told:
            hangs = self._watch(child, told.fileno(), say)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        self.done = struct.unpack("q", self._current[:8])[0]
        if status != 0:
            name, _ = self.case(self.done)
            self._failed(name, "hangs" if hangs else f"ends the process ({status})", say)
            self.done += 1

    def _watch(self, child: int, told: int, say: Callable[[str], None]) -> bool:
        """Say what a child tells until it ends; kill one that hangs, and return whether it did."""
        rest, last, since = "", -1, time.monotonic()
        while True:
            if select.select([told], [], [], 1.0)[0]:
                content = os.read(told, 65536)
                if not content:
                    return False
                *lines, rest = (rest + content.decode(errors="replace")).split("\n")
                for line in lines:
                    name, _, why = line.partition("\t")
                    self._failed(name, why, say)
            now = struct.unpack("q", self._current[:8])[0]
            if now != last:
                last, since = now, time.monotonic()
            elif time.monotonic() - since > LONGEST_CASE_S:
                os.kill(child, signal.SIGKILL)
                return True

    def _failed(self, name: str, why: str, say: Callable[[str], None]) -> None:
        kind = f"{name.partition('@')[0]} {why.partition(':')[0]}"
        if kind not in self._kinds:
            self._kinds.add(kind)
            say(f"FAILED {name}: {why}\n  ./run fuzz --repeat '{name}'")

    def _work(self, end: float, cases: int, tell: Callable[[str], None]) -> None:
        if self._memory:
            resource.setrlimit(resource.RLIMIT_AS, (self._memory, self._memory))
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", ChangedFileWarning)
        number = self.done
        while time.monotonic() < end and number < cases:
            self._current[:8] = struct.pack("q", number)
            name, work = self.case(number)
            try:
                work(name)
            except Exception as error:
                place = traceback.extract_tb(error.__traceback__)[-1]
                where = f"{Path(place.filename).name} line {place.lineno}"
                tell(f"{name}\t{type(error).__name__} in {where}: {error}".replace("\n", " "))
            number += 1
        self._current[:8] = struct.pack("q", number)
