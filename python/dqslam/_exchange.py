"""The exchange of two folders in one step, and the temporary folders that wait for it."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import fcntl
import os
import re
import secrets
import shutil
from pathlib import Path

_TEMPORARY = ".dqslam-tmp"
_ASIDE = ".dqslam-old"
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2
_NOT_SUPPORTED = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)


def new_stage(folder: Path, *, inside: bool) -> tuple[Path, int]:
    """Make a temporary folder beside a folder, or inside, and return it with its lock.

    The system releases the lock when the process ends, however it ends.
    """
    name = f".{folder.name}.{secrets.token_hex(8)}{_TEMPORARY}"
    if inside:
        folder.mkdir(parents=True, exist_ok=True)
    stage = folder / name if inside else folder.with_name(name)
    stage.mkdir()
    lock = os.open(stage, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return stage, lock


def release(lock: int) -> None:
    """Give a lock back."""
    os.close(lock)


def is_stage(name: str) -> bool:
    """Whether a name in a folder is that of a temporary folder."""
    return re.fullmatch(r"\..*\.[0-9a-f]{16}" + re.escape(_TEMPORARY), name) is not None


def remove_stale_stages(folder: Path) -> None:
    """Remove the temporary folders of processes that were killed while they wrote this folder."""
    for place in (folder.parent, folder):
        if not place.is_dir():
            continue
        for entry in os.scandir(place):
            if is_stage(entry.name) and entry.name.startswith(f".{folder.name}."):
                _remove_if_stale(entry)


def _remove_if_stale(entry: os.DirEntry[str]) -> None:
    with contextlib.suppress(OSError):
        if not entry.is_dir(follow_symlinks=False) or entry.stat().st_uid != os.geteuid():
            return
        handle = os.open(entry.path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)  # fails while its process lives
            shutil.rmtree(entry.path, ignore_errors=True)
        finally:
            os.close(handle)


def cannot_be_renamed(folder: Path) -> bool:
    """Whether a folder is a mount point, holds the current directory, or has a closed parent."""
    current = Path.cwd()
    if folder == current or folder in current.parents or os.path.ismount(folder):
        return True
    return str(folder) in _mount_points() or not os.access(folder.parent, os.W_OK | os.X_OK)


def _mount_points() -> set[str]:
    """Return the places of all mounts, among them those of folders of the same file system."""
    try:
        lines = Path("/proc/self/mountinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return {re.sub(r"\\(\d{3})", lambda one: chr(int(one[1], 8)), ln.split()[4]) for ln in lines}


def exchange(new: Path, old: Path) -> None:
    """Let two folders exchange their names.

    Where the file system cannot do that in one step, the old folder is renamed first, and
    ``recover`` takes it back if the process ends before the second step.
    """
    with contextlib.suppress(NotImplementedError):
        _exchange_at_once(new, old)
        return
    aside = _aside(old)
    os.rename(old, aside)
    try:
        os.rename(new, old)
    except BaseException:
        os.rename(aside, old)
        raise
    os.rename(aside, new)


def _exchange_at_once(new: Path, old: Path) -> None:
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        raise NotImplementedError
    names = (_AT_FDCWD, os.fsencode(new), _AT_FDCWD, os.fsencode(old))
    if rename(*names, _RENAME_EXCHANGE) != 0:
        number = ctypes.get_errno()
        if number in _NOT_SUPPORTED:
            raise NotImplementedError
        raise OSError(number, os.strerror(number), str(old))


def _aside(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}{_ASIDE}")


def standing(folder: Path) -> Path:
    """Return where a folder's set is, if a process was killed between the two steps."""
    aside = _aside(Path(os.path.realpath(folder)))
    return aside if not folder.exists() and _is_set_aside(aside) else folder


def _is_set_aside(aside: Path) -> bool:
    return not aside.is_symlink() and (aside / "manifest.json").is_file()


def recover(folder: Path) -> None:
    """Take back the old folder of a process that was killed between the two steps."""
    aside = _aside(folder)
    if not _is_set_aside(aside):
        return
    if not folder.exists():
        os.rename(aside, folder)
    else:  # the new one is there: the old one becomes a temporary folder, which is removed
        os.rename(aside, folder.with_name(f".{folder.name}.{secrets.token_hex(8)}{_TEMPORARY}"))
