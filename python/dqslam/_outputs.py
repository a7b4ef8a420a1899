"""Folders of results: one set of files, which is there as a whole or not at all.

A set is written into a temporary folder beside its own, with a manifest. Then both folders are
exchanged in one step of the file system: a process that is killed leaves the old set or the new.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from dqslam._exchange import (
    cannot_be_renamed,
    exchange,
    is_stage,
    new_stage,
    recover,
    release,
    remove_stale_stages,
)
from dqslam._files import FileError, input_place, is_input, sync, uninterrupted
from dqslam._manifest import (
    NAME,
    Manifest,
    describe,
    digest,
    manifest_or_none,
    not_written,
    read_manifest,
    remove_written,
    write_manifest,
)

_MOST_NAMED = 3


@contextlib.contextmanager
def output_set(
    path: str | Path,
    written_by: str,
    *,
    inputs: Iterable[str | Path | None] = (),
    beside_others: bool = False,
) -> Iterator[Path]:
    """Give a temporary folder whose files become the content of a folder, all at once.

    The folder may be new, empty, or of an earlier call with the same ``written_by``, whose files
    have not been changed and are gone afterwards. If the body fails, nothing has changed.

    Parameters
    ----------
    path
        The folder. A link to a folder stays a link.
    written_by
        The command or function, for the manifest.
    inputs
        Files and folders that are read, which must not be among the files that are replaced.
    beside_others
        Whether the folder may have other files. Then files are exchanged one by one, and until
        all are, the manifest says that the set is not complete.

    Raises
    ------
    FileError
        Before the body, if the folder has files of others or inputs, or cannot be written; after
        it, if the files cannot be written.
    """
    folder = Path(os.path.realpath(path))
    with contextlib.ExitStack() as undo:  # Ctrl-C, too, leaves nothing, whenever it comes
        try:
            recover(folder)
            others = _check(folder, path, written_by, inputs, beside_others)
            undo.callback(_remove_empty, _missing(folder))
            # Made before the work, which would be in vain if it could not be made.
            folder.mkdir(parents=True, exist_ok=True)
            remove_stale_stages(folder)
            in_place = bool(others) or cannot_be_renamed(folder)
            stage, lock = new_stage(folder, inside=in_place)
            undo.callback(release, lock)
            undo.callback(shutil.rmtree, stage, ignore_errors=True)
            yield stage
            with uninterrupted():
                _commit(stage, folder, written_by, in_place=in_place)
        except FileError as error:
            raise _renamed(error, folder, path) from None
        except OSError as error:
            raise FileError(path, f"cannot be written: {error.strerror or error}") from None


def check_output_set(
    path: str | Path, written_by: str, *, inputs: Iterable[str | Path | None] = ()
) -> None:
    """Raise FileError if ``output_set`` would refuse the folder; nothing is made."""
    _check(Path(os.path.realpath(path)), path, written_by, inputs, beside_others=False)


def _check(
    folder: Path,
    shown: str | Path,
    written_by: str,
    inputs: Iterable[str | Path | None],
    beside_others: bool,
) -> dict[str, str]:
    """Return what a folder has beside its own set; refuse it if that is not allowed."""
    if not folder.exists():
        return {}
    if not folder.is_dir():
        raise FileError(shown, "is a file, not a folder")
    read = _inputs_in(folder, inputs)
    if read:
        raise FileError(shown, f"holds {_listed(read)}, read by this run: choose another folder")
    manifest = manifest_or_none(folder)
    if manifest is None:
        others = dict.fromkeys(_entries(folder), "")
        if others and not beside_others:
            raise FileError(shown, "is there already, and not empty: choose another folder")
        return others
    if manifest.written_by != written_by:
        raise FileError(shown, f"holds what {manifest.written_by} wrote: choose another folder")
    others = not_written(folder, manifest)
    changed = [name for name, why in others.items() if why.startswith("changed")]
    wrong = changed or ([] if beside_others else list(others))
    if wrong:
        raise FileError(
            shown,
            f"holds {_listed(wrong)}, {others[wrong[0]]} (its {NAME} tells): move that away or "
            "choose another folder",
        )
    return others


def _entries(folder: Path) -> list[str]:
    return sorted(entry.name for entry in os.scandir(folder) if not is_stage(entry.name))


def _inputs_in(folder: Path, inputs: Iterable[str | Path | None]) -> list[str]:
    found = []
    for one in inputs:
        real = Path(os.path.realpath(input_place(one))) if one is not None else None
        if real is not None and real.exists() and (real == folder or folder in real.parents):
            found.append(real.name)
    return found


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return ", ".join(names[:_MOST_NAMED]) + more


def _missing(folder: Path) -> list[Path]:
    """Return the folders that have to be made for a folder, itself first."""
    return [one for one in (folder, *folder.parents) if not one.exists()]


def _remove_empty(folders: list[Path]) -> None:
    with contextlib.suppress(OSError):  # it is not empty
        for one in folders:
            one.rmdir()


def _renamed(error: FileError, folder: Path, path: str | Path) -> FileError:
    """Let an error of a file in a temporary folder name the place where it was to be."""
    for place in (folder.parent, folder):
        for part in re.findall(re.escape(str(place)) + r"/(\.[^/]*)", str(error)):
            if is_stage(part):
                error.args = (str(error).replace(str(place / part), str(path)),)
    return error


def _commit(stage: Path, folder: Path, written_by: str, *, in_place: bool) -> None:
    manifest = describe(stage, written_by)
    if in_place:
        _move_in(stage, folder, manifest)
        return
    before = manifest_or_none(folder)
    write_manifest(stage, manifest)
    for inner, _, names in os.walk(stage, topdown=False):
        for name in names:
            sync(os.path.join(inner, name))
        sync(inner)
    if not folder.exists() or not any(folder.iterdir()):
        folder.parent.mkdir(parents=True, exist_ok=True)
        os.rename(stage, folder)
    elif before is None or before.written_by != written_by:
        raise FileError(folder, "was filled by others during the work: choose another folder")
    else:
        shutil.copymode(folder, stage)
        exchange(stage, folder)
        _keep_others(stage, folder)
    sync(folder.parent)


def _keep_others(old: Path, new: Path) -> None:
    """Move into the new folder what somebody has put into the old one during the work."""
    for name in not_written(old, manifest_or_none(old)):
        kept = new / name if not (new / name).exists() else new / f"{name}.changed"
        kept.parent.mkdir(parents=True, exist_ok=True)
        os.rename(old / name, kept)


def _move_in(stage: Path, folder: Path, manifest: Manifest) -> None:
    """Exchange the files of a folder one by one, where it cannot be renamed or has others."""
    before = manifest_or_none(folder) or Manifest(manifest.written_by)
    others = not_written(folder, before).keys() & manifest.files.keys()
    if others:
        raise FileError(folder / min(others), f"is there already, and {NAME} does not list it")
    either = {
        name: before.files.get(name, ()) + manifest.files.get(name, ())
        for name in {**before.files, **manifest.files}
    }
    write_manifest(folder, replace(manifest, files=either, complete=False))
    for name in manifest.files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        sync(stage / name)
        os.replace(stage / name, folder / name)
    remove_written(folder, before, keep=manifest.files)
    sync(folder)
    write_manifest(folder, manifest)


def claim_folder(path: str | Path, written_by: str) -> Path:
    """Make a folder into which files come one by one, or go on with one of an earlier call.

    Raises
    ------
    FileError
        If the folder has files and no manifest of ``written_by``, or cannot be written.
    """
    folder = Path(os.path.realpath(path))
    manifest = manifest_or_none(folder) if folder.is_dir() else None
    if manifest is None or manifest.written_by != written_by:
        _check(folder, path, written_by, (), beside_others=False)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(path, f"cannot be written: {error.strerror}") from None
        write_manifest(folder, Manifest(written_by))
    return folder


def check_added(
    folder: str | Path,
    names: Iterable[str],
    written_by: str,
    *,
    inputs: Iterable[str | Path | None] = (),
) -> None:
    """Raise FileError if ``added_files`` would replace a file that is not its own, or an input.

    A file of the set itself may be an input: options that were read are written again.
    """
    folder, given = Path(folder), [one for one in inputs if one is not None]
    manifest = read_manifest(folder) or Manifest(written_by)
    for name in names:
        path = folder / name
        if not path.exists() and not path.is_symlink():
            continue
        if any(is_input(path, one) for one in given):
            raise FileError(path, "is an input, which would be written over")
        if name not in manifest.files:
            raise FileError(path, f"is there already, and {NAME} does not list it: move it away")
        if path.is_symlink() or digest(path) not in manifest.files[name]:
            raise FileError(path, f"has been changed since {written_by} wrote it: move it away")


@contextlib.contextmanager
def added_files(
    folder: str | Path,
    names: Iterable[str],
    written_by: str,
    *,
    inputs: Iterable[str | Path | None] = (),
) -> Iterator[Path]:
    """Give a temporary folder whose files, with these names, are added to an existing folder.

    The manifest lists them afterwards, so that they go with the set they were made from. Each file
    is complete or absent.

    Raises
    ------
    FileError
        As ``check_added``, before and after the body; or if the files cannot be written.
    """
    folder, names, inputs = Path(folder), tuple(names), tuple(inputs)
    check_added(folder, names, written_by, inputs=inputs)
    try:
        stage, lock = new_stage(folder, inside=True)
    except OSError as error:
        raise FileError(folder, f"cannot be written: {error.strerror}") from None
    try:
        yield stage
        with uninterrupted():
            check_added(folder, names, written_by, inputs=inputs)
            _add(stage, folder, written_by)
    except FileError as error:
        raise _renamed(error, folder, folder) from None
    except OSError as error:
        raise FileError(folder, f"cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        release(lock)


def _add(stage: Path, folder: Path, written_by: str) -> None:
    before = read_manifest(folder) or Manifest(written_by)
    added = describe(stage, written_by).files
    either = {name: before.files.get(name, ()) + found for name, found in added.items()}
    write_manifest(folder, replace(before, files={**before.files, **either}))
    for name in added:
        sync(stage / name)
        os.replace(stage / name, folder / name)
    write_manifest(folder, replace(before, files={**before.files, **added}))


def belongs_to(folder: Path, drawn: Path) -> None:
    """Note in the manifest of a folder that a folder in it was drawn from its content."""
    manifest = manifest_or_none(folder)
    inside = drawn.resolve()
    if manifest is None or inside.parent != folder.resolve() or inside.name in manifest.folders:
        return
    write_manifest(folder, replace(manifest, folders=(*manifest.folders, inside.name)))
