"""Manifests: which files of a folder were written by whom, and what was in them.

``manifest.json`` has ``written_by``, ``dqslam_version``, ``complete``, the SHA-256 of each file by
its path in the folder, and the names of folders in it that have manifests of their own.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import stat
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from dqslam._exchange import is_stage
from dqslam._files import FileError, write_text
from dqslam._input import read_text
from dqslam._version import version

NAME = "manifest.json"


class ChangedFileWarning(UserWarning):
    """A file is not the one that was written with the others of its folder."""


@dataclass(frozen=True)
class Manifest:
    """The content of ``manifest.json``."""

    written_by: str
    """The command, as in ``dqslam run``, or the function."""
    files: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """SHA-256 of each file by its path in the folder; two while one replaces the other."""
    folders: tuple[str, ...] = ()
    """Folders in the folder with manifests of their own, as of figures."""
    complete: bool = True
    """False while files are exchanged one by one."""


def read_manifest(folder: str | Path) -> Manifest | None:
    """Read the manifest of a folder; None if there is none.

    Raises
    ------
    FileError
        If the file is no manifest.
    """
    path = Path(folder) / NAME
    if not path.is_file():
        return None
    try:
        content = json.loads(read_text(path))
        files = {str(name): _hashes(found) for name, found in content["files"].items()}
        folders = tuple(map(_plain_name, content.get("folders", ())))
        return Manifest(str(content["written_by"]), files, folders, content["complete"] is True)
    except FileError:
        raise
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        raise FileError(path, "is not a manifest that dqslam has written") from None


def _hashes(found: object) -> tuple[str, ...]:
    return tuple(map(str, found)) if isinstance(found, list) else (str(found),)


def _plain_name(name: str) -> str:
    if Path(name).name != name or name == "..":
        raise ValueError(name)
    return name


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write the manifest of a folder."""
    content = {
        "written_by": manifest.written_by,
        "dqslam_version": version(),
        "complete": manifest.complete,
        "files": {
            name: found[0] if len(found) == 1 else list(found)
            for name, found in sorted(manifest.files.items())
        },
        "folders": sorted(manifest.folders),
    }
    write_text(folder / NAME, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def digest(path: str | Path) -> str:
    """Return the SHA-256 of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def files_in(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield what is in a folder and in its folders, with the path in it; links are not followed.

    Folders are not yielded, the manifest of the folder itself and temporary folders neither.
    """
    for entry in sorted(os.scandir(folder), key=lambda entry: entry.name):
        if is_stage(entry.name):
            continue
        if entry.is_dir(follow_symlinks=False):
            for name, path in files_in(Path(entry.path)):
                yield f"{entry.name}/{name}", path
            if (inside := Path(entry.path) / NAME).is_file():
                yield f"{entry.name}/{NAME}", inside
        elif entry.name != NAME:
            yield entry.name, Path(entry.path)


def describe(folder: Path, written_by: str) -> Manifest:
    """Make the manifest of a folder; folders in it that have one keep theirs."""
    sets = tuple(
        entry.name
        for entry in os.scandir(folder)
        if entry.is_dir(follow_symlinks=False) and (Path(entry.path) / NAME).is_file()
    )
    files = {
        name: (digest(path),)
        for name, path in files_in(folder)
        if name.partition("/")[0] not in sets
    }
    return Manifest(written_by, files, sets)


def not_written(folder: Path, manifest: Manifest | None) -> dict[str, str]:
    """Return what is in a folder and was not written with its manifest, with what it is instead."""
    manifest = manifest or Manifest("")
    found: dict[str, str] = {}
    sets = set()
    for one in manifest.folders:
        inner = manifest_or_none(folder / one)
        if inner is not None and not (folder / one).is_symlink():
            sets.add(one)
            others = not_written(folder / one, inner)
            found |= {f"{one}/{name}": why for name, why in others.items()}
    for name, path in files_in(folder):
        if name.partition("/")[0] in sets:
            continue
        if name not in manifest.files:
            found[name] = "not written by it"
        elif not _has_digest(path, manifest.files[name]):
            found[name] = "changed since"
    return found


def manifest_or_none(folder: Path) -> Manifest | None:
    """Read the manifest of a folder; None for somebody else's file of that name, too."""
    try:
        return read_manifest(folder)
    except FileError:
        return None


def _has_digest(path: Path, digests: tuple[str, ...]) -> bool:
    is_plain = stat.S_ISREG(path.lstat().st_mode)
    return is_plain and digest(path) in digests


def remove_written(folder: Path, manifest: Manifest, keep: Iterable[str] = ()) -> None:
    """Remove the files that were written with a manifest and are as they were; keep some names."""
    kept = set(keep)
    others = not_written(folder, manifest)
    for name, path in list(files_in(folder)):
        if name not in others and name not in kept:
            path.unlink()
    for one in manifest.folders:
        with contextlib.suppress(OSError):  # it has files of others
            (folder / one).rmdir()


def complete_manifest(folder: Path) -> Manifest | None:
    """Read the manifest of a folder; None if there is none.

    Raises
    ------
    FileError
        If the file is no manifest, or says that the files were being exchanged one by one.
    """
    manifest = read_manifest(folder)
    if manifest is not None and not manifest.complete:
        raise FileError(folder, "the writing of its files was interrupted: write them again")
    return manifest


def check_files(folder: Path, names: Iterable[str]) -> None:
    """Compare files that were read with the manifest of their folder, if it has one.

    A file that somebody has changed, added or taken away is a ChangedFileWarning. For errors, see
    ``complete_manifest``.
    """
    names, manifest = tuple(names), complete_manifest(folder)
    if manifest is None or manifest.files.keys().isdisjoint(names):
        return  # it is of files that were added to a folder without one
    for name in names:
        path, hashes = folder / name, manifest.files.get(name)
        if hashes is None and path.exists():
            _warn(path, f"is not of these results: {NAME} does not list it")
        elif hashes is not None and not path.exists():
            _warn(path, f"is missing, though {NAME} lists it")
        elif hashes is not None and digest(path) not in hashes:
            _warn(path, "has been changed since it was written with the other files")


def _warn(path: Path, message: str) -> None:
    warnings.warn(f"{path}: {message}", ChangedFileWarning, stacklevel=4)
