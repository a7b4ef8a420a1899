"""The interpreter that gtsam_quadrics needs, in an environment of its own."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.measure import ROOT, Command

_VENV = ROOT / "build" / "bench" / "gtsam_quadrics"
_REQUIREMENTS = ("gtsam_quadrics==0.3.0", "numpy<2")  # the only release, for Python 3.10 only


class PeerMissingError(Exception):
    """Says why a peer cannot run here."""


def gtsam_command(say: Callable[[str], None]) -> Command:
    """Return what solves with gtsam_quadrics; the first call makes its environment.

    Raises
    ------
    PeerMissingError
        Where there is no Python 3.10, or the package cannot be installed.
    """
    interpreter = _VENV / "bin" / "python"
    if not _works([str(interpreter), "-c", "import gtsam, gtsam_quadrics"]):
        say(f"installing {_REQUIREMENTS[0]} into {_VENV.relative_to(ROOT)}")
        _install(interpreter)
    return [str(interpreter), "-m", "benchmarks.programs.run_gtsam"]


def _install(interpreter: Path) -> None:
    python = next((one for one in _candidates() if _works([one, "-c", "import venv"])), None)
    if python is None:
        raise PeerMissingError("no python3.10 with venv was found; DQSLAM_PYTHON310 may name one")
    for command in (
        [python, "-m", "venv", "--clear", str(_VENV)],
        [str(interpreter), "-m", "pip", "install", "--quiet", *_REQUIREMENTS],
        [str(interpreter), "-c", "import gtsam, gtsam_quadrics"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL)
        if done.returncode != 0:
            said = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
            raise PeerMissingError(f"gtsam_quadrics could not be installed: {said}")


def _candidates() -> Iterator[str]:
    """Name interpreters: the one asked for, that on the path, and those that pyenv keeps."""
    if chosen := os.environ.get("DQSLAM_PYTHON310"):
        yield chosen
    if found := shutil.which("python3.10"):
        yield found
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    yield from map(str, sorted(pyenv.glob("versions/3.10.*/bin/python3.10")))


def _works(command: Command) -> bool:
    try:
        return (
            subprocess.run(command, capture_output=True, stdin=subprocess.DEVNULL).returncode == 0
        )
    except OSError:
        return False
