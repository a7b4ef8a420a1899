"""Folders of results: refused before the work if they are others', replaced as a whole if not."""

import json
import os
import warnings

import pytest

from dqslam import _exchange
from dqslam._files import FileError
from dqslam._manifest import (
    NAME,
    ChangedFileWarning,
    Manifest,
    check_files,
    digest,
    read_manifest,
    write_manifest,
)
from dqslam._outputs import added_files, belongs_to, check_output_set, claim_folder, output_set

# Of the text "abc", from FIPS 180-4.
ABC = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def write(path, files, *, by="dqslam run", **options):
    with output_set(path, by, **options) as folder:
        for name, text in files.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text)


def content(folder):
    """Return the texts of all files, those of the manifest aside."""
    found = {
        str(path.relative_to(folder)): path.read_text()
        for path in folder.rglob("*")
        if path.is_file() and path.name != NAME
    }
    return dict(sorted(found.items()))


@pytest.fixture(params=["exchange", "two renames", "in place"])
def way(request, monkeypatch):
    """Each way in which a set can come to its place."""
    if request.param == "two renames":

        def refuse(new, old):
            raise NotImplementedError

        monkeypatch.setattr(_exchange, "_exchange_at_once", refuse)
    if request.param == "in place":
        monkeypatch.setattr("dqslam._outputs.cannot_be_renamed", lambda folder: True)
    return request.param


@pytest.mark.usefixtures("way")
def test_the_files_of_an_earlier_run_are_gone(tmp_path):
    out = tmp_path / "new" / "out"
    write(out, {"a": "abc", "b": "old", "images/c": "old"})
    manifest = read_manifest(out)
    assert manifest.files["a"] == (ABC,)
    assert set(manifest.files) == {"a", "b", "images/c"}
    write(out, {"a": "new", "images/d": "new"})
    assert content(out) == {"a": "new", "images/d": "new"}
    assert set(read_manifest(out).files) == {"a", "images/d"}
    assert read_manifest(out).complete
    assert os.listdir(tmp_path / "new") == ["out"]
    assert sorted(os.listdir(out)) == ["a", "images", NAME]


@pytest.mark.usefixtures("way")
def test_an_error_leaves_the_old_files(tmp_path):
    out = tmp_path / "out"
    write(out, {"a": "old"})
    with pytest.raises(ZeroDivisionError), output_set(out, "dqslam run") as folder:
        (folder / "a").write_text("new")
        _ = 1 / 0
    assert content(out) == {"a": "old"}
    assert os.listdir(tmp_path) == ["out"]


def test_an_error_leaves_no_folder(tmp_path):
    with pytest.raises(KeyboardInterrupt), output_set(tmp_path / "a" / "b", "dqslam run"):
        raise KeyboardInterrupt
    assert os.listdir(tmp_path) == []


def refuse(path, match, **options):
    before = content(path) if path.is_dir() else None
    with pytest.raises(FileError, match=match) as caught, output_set(path, "dqslam run", **options):
        pytest.fail("the work has begun")
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    if before is not None:
        assert content(path) == before


def test_folders_of_others_are_refused_before_the_work(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    check_output_set(out, "dqslam run")
    (out / "boxes.csv").write_text("mine")
    refuse(out, "is there already, and not empty")
    refuse(out / "boxes.csv", "is a file, not a folder")
    (out / "boxes.csv").unlink()
    (out / "empty").mkdir()
    refuse(out, "not empty")
    refuse(tmp_path, "not empty")


def test_another_commands_folder_is_refused(tmp_path):
    write(tmp_path / "out", {"a": "abc"}, by="dqslam simulate")
    refuse(tmp_path / "out", "holds what dqslam simulate wrote")


def test_files_that_were_added_or_changed_are_refused(tmp_path):
    out = tmp_path / "out"
    write(out, {"a": "abc", "b": "b"})
    (out / "notes").write_text("mine")
    refuse(out, r"holds notes, not written by it")
    (out / "notes").unlink()
    (out / "a").write_text("abd")
    refuse(out, "holds a, changed since")
    (out / "a").unlink()
    (out / "a").symlink_to(tmp_path / "elsewhere")
    refuse(out, "holds a, changed since")
    (out / "a").unlink()
    write(out, {"a": "c"})  # a file that was taken away is nobody's
    assert content(out) == {"a": "c"}


def test_a_manifest_of_others_makes_nothing_ones_own(tmp_path):
    out = tmp_path / "out"
    write(out, {"a": "abc"})
    (out / NAME).write_text('{"name": "an app"}')
    refuse(out, "not empty")
    with pytest.raises(FileError, match="manifest.json: is not a manifest"):
        check_files(out, ["a"])


@pytest.mark.parametrize("through_link", [False, True])
def test_inputs_are_named(tmp_path, through_link):
    rec = tmp_path / "rec"
    rec.mkdir()
    names = ["camera.json", "odometry.txt", "boxes.csv", "more"]
    for name in names:
        (rec / name).write_text(name)
    out = rec
    if through_link:
        (tmp_path / "link").symlink_to(rec)
        out = tmp_path / "link"
    inputs = [rec / name for name in names]
    refuse(out, "holds camera.json, odometry.txt, boxes.csv and 1 more, read by", inputs=inputs)
    refuse(out, "holds rec, read by this run", inputs=[tmp_path / "rec", None])


def test_ones_own_files_as_inputs_are_refused(tmp_path):
    out = tmp_path / "out"
    write(out, {"boxes.csv": "abc"})
    refuse(out, "holds boxes.csv, read by this run", inputs=[out / "boxes.csv"])
    (tmp_path / "link").symlink_to(out / "boxes.csv")
    refuse(out, "holds boxes.csv, read by this run", inputs=[tmp_path / "link"])


def test_a_link_to_a_folder_stays_a_link(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "out")
    for text in ("one", "two"):
        write(tmp_path / "link", {"a": text})
        assert (tmp_path / "link").is_symlink()
        assert content(tmp_path / "out") == {"a": text}


def test_the_folder_keeps_its_mode(tmp_path):
    out = tmp_path / "out"
    write(out, {"a": "old"})
    assert out.stat().st_mode & 0o777 == 0o777 & ~_umask()
    out.chmod(0o750)
    write(out, {"a": "new"})
    assert out.stat().st_mode & 0o777 == 0o750


def _umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_the_current_folder_is_not_pulled_away(tmp_path, monkeypatch):
    out = tmp_path / "out"
    out.mkdir()
    monkeypatch.chdir(out)
    for text in ("one", "two"):
        write(".", {"a": text})
        assert os.listdir() and content(out) == {"a": text}


def test_files_that_come_during_the_work_are_kept(tmp_path):
    out = tmp_path / "out"
    write(out, {"a": "old"})
    with output_set(out, "dqslam run") as folder:
        (folder / "a").write_text("new")
        (out / "notes").write_text("mine")
        (out / "a").write_text("edited")
    assert content(out) == {"a": "new", "a.changed": "edited", "notes": "mine"}


def test_beside_others_ones_own_files_are_exchanged_and_theirs_are_not(tmp_path):
    (tmp_path / "notes").write_text("mine")
    write(tmp_path, {"a": "old", "b": "old"}, beside_others=True)
    write(tmp_path, {"a": "new"}, beside_others=True)
    assert content(tmp_path) == {"a": "new", "notes": "mine"}
    with pytest.raises(FileError, match="notes: is there already"):
        write(tmp_path, {"notes": "theirs"}, beside_others=True)
    assert content(tmp_path) == {"a": "new", "notes": "mine"}


def test_a_dead_process_leaves_nothing_behind_and_a_live_one_is_left_alone(tmp_path):
    out = tmp_path / "out"
    stale, _lock = _exchange.new_stage(out, inside=False)
    _exchange.release(_lock)
    alive, lock = _exchange.new_stage(out, inside=False)
    (tmp_path / ".other.0123456789abcdef.dqslam-tmp").mkdir()
    write(out, {"a": "new"})
    assert not stale.exists()
    assert alive.exists()
    _exchange.release(lock)
    assert (tmp_path / ".other.0123456789abcdef.dqslam-tmp").exists()


def test_added_files_go_with_the_set(tmp_path):
    out = tmp_path / "out"
    write(out, {"a": "old"})
    for text in ("one", "two"):
        with added_files(out, ["e.json"], "dqslam evaluate") as folder:
            (folder / "e.json").write_text(text)
        assert content(out) == {"a": "old", "e.json": text}
    write(out, {"a": "new"})
    assert content(out) == {"a": "new"}


def test_added_files_replace_none_of_others(tmp_path):
    def add(**options):
        with added_files(tmp_path, ["e.json"], "dqslam evaluate", **options) as folder:
            (folder / "e.json").write_text("new")

    (tmp_path / "e.json").write_text("mine")
    with pytest.raises(FileError, match="e.json: is there already"):
        add()
    (tmp_path / "e.json").unlink()
    add()
    with pytest.raises(FileError, match="e.json: is an input"):
        add(inputs=[tmp_path / "e.json"])
    (tmp_path / "e.json").write_text("mine")
    with pytest.raises(FileError, match="e.json: has been changed since dqslam evaluate wrote it"):
        add()
    assert (tmp_path / "e.json").read_text() == "mine"


def test_folders_that_were_drawn_from_a_set_go_with_it_unless_others_are_in_them(tmp_path):
    out = tmp_path / "out"
    write(out, {"a": "old"})
    write(out / "figures", {"map.svg": "old"}, by="dqslam plot")
    belongs_to(out, out / "figures")
    belongs_to(out, tmp_path / "elsewhere")
    assert read_manifest(out).folders == ("figures",)
    (out / "figures" / "mine").write_text("mine")
    refuse(out, "holds figures/mine, not written by it")
    (out / "figures" / "mine").unlink()
    write(out, {"a": "new"})
    assert content(out) == {"a": "new"}


def test_a_folder_that_is_filled_slowly(tmp_path):
    claim_folder(tmp_path / "sweep", "dqslam sweep")
    (tmp_path / "sweep" / "trial").write_text("1")
    claim_folder(tmp_path / "sweep", "dqslam sweep")
    with pytest.raises(FileError, match="holds what dqslam sweep wrote"):
        claim_folder(tmp_path / "sweep", "dqslam run")
    with pytest.raises(FileError, match="not empty"):
        claim_folder(tmp_path, "dqslam sweep")


def test_what_differs_from_the_manifest_is_told(tmp_path):
    write(tmp_path / "out", {"a": "abc", "b": "b", "c": "c"})
    out = tmp_path / "out"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_files(out, ["a", "b", "c", "d"])
    (out / "a").write_text("abd")
    (out / "b").unlink()
    (out / "d").write_text("from elsewhere")
    with pytest.warns(ChangedFileWarning) as found:
        check_files(out, ["a", "b", "c", "d"])
    assert [str(one.message) for one in found] == [
        f"{out / 'a'}: has been changed since it was written with the other files",
        f"{out / 'b'}: is missing, though manifest.json lists it",
        f"{out / 'd'}: is not of these results: manifest.json does not list it",
    ]


def test_a_manifest_of_added_files_says_nothing_of_others(tmp_path):
    (tmp_path / "a").write_text("abc")
    with added_files(tmp_path, ["e"], "dqslam evaluate") as folder:
        (folder / "e").write_text("new")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_files(tmp_path, ["a", "b"])


def test_an_interrupted_exchange_is_an_error(tmp_path):
    write_manifest(tmp_path, Manifest("dqslam run", {"a": (ABC, "0")}, complete=False))
    with pytest.raises(FileError, match="the writing of its files was interrupted"):
        check_files(tmp_path, ["a"])
    assert json.loads((tmp_path / NAME).read_text())["files"] == {"a": [ABC, "0"]}


def test_a_manifest_reaches_no_file_outside(tmp_path):
    victim, out = tmp_path / "victim", tmp_path / "out"
    victim.write_text("precious")
    write(out, {"a": "abc"})
    hostile = {"../victim": (digest(victim),), "a": (ABC,)}
    write_manifest(out, Manifest("dqslam run", hostile, folders=("..",)))
    with pytest.raises(FileError):
        write(out, {"a": "new"})
    assert victim.read_text() == "precious"
