"""Single files: whole or absent, links kept, pipes and devices written to, Ctrl-C put off."""

import os
import signal
import stat
import subprocess
import sys
import threading

import pytest

from dqslam._files import FileError, refuse_inputs, uninterrupted, whole_file, write_text


def test_a_file_is_replaced_whole_and_keeps_its_mode(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    path.chmod(0o640)
    with pytest.raises(ValueError, match="x"), whole_file(path) as temporary:
        temporary.write_text("half")
        raise ValueError("x")
    assert path.read_text() == "old"
    write_text(path, ["new\n", "lines\n"])
    assert path.read_text() == "new\nlines\n"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_link_stays_and_what_it_leads_to_is_written(tmp_path):
    (tmp_path / "real").mkdir()
    target, link = tmp_path / "real" / "a.txt", tmp_path / "a.txt"
    link.symlink_to(target)
    for text in ("first", "second"):  # of a link to nothing yet, and of one to a file
        write_text(link, text)
        assert link.is_symlink()
        assert target.read_text() == text


def test_a_planted_link_under_the_temporary_name_is_not_followed(tmp_path, monkeypatch):
    victim = tmp_path / "victim"
    victim.write_text("precious")
    monkeypatch.setattr("secrets.token_hex", lambda size: "0" * 2 * size)
    (tmp_path / f".a.{'0' * 16}.tmp.txt").symlink_to(victim)
    with pytest.raises(FileError, match=r"a\.txt: cannot be written: File exists"):
        write_text(tmp_path / "a.txt", "new")
    assert victim.read_text() == "precious"


def test_a_pipe_is_written_to(tmp_path):
    path, read = tmp_path / "pipe", []
    os.mkfifo(path)
    reader = threading.Thread(target=lambda: read.append(path.read_text()))
    reader.start()
    write_text(path, "through")
    reader.join(timeout=10)
    assert read == ["through"]
    assert stat.S_ISFIFO(path.stat().st_mode)


def test_a_device_stays_a_device():
    write_text("/dev/null", "away")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    with pytest.raises(FileError, match="/dev/full: cannot be written: No space left on device"):
        write_text("/dev/full", "more")


def test_standard_output_that_is_a_file_is_not_replaced_or_begun_again(tmp_path):
    path = tmp_path / "log"
    path.write_text("before\n")
    code = (
        "from dqslam._files import write_text; print('one', flush=True); "
        "write_text('/dev/stdout', 'two\\n'); print('three')"
    )
    with path.open("a") as log:
        subprocess.run([sys.executable, "-c", code], stdout=log, check=True)
    assert path.read_text() == "before\none\ntwo\nthree\n"


def test_folders_and_sockets_are_refused(tmp_path):
    with pytest.raises(FileError, match="cannot be written: Is a directory"):
        write_text(tmp_path, "text")


def test_an_input_is_no_output_under_another_name(tmp_path):
    (tmp_path / "a").write_text("")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    os.link(tmp_path / "a", tmp_path / "c")
    refuse_inputs(tmp_path / "new", [tmp_path / "a", None])
    for name in ("b", "c"):
        with pytest.raises(FileError, match=f"{name}: is an input"):
            refuse_inputs(tmp_path / name, [None, tmp_path / "a"])


@pytest.fixture
def listening():
    """Ctrl-C is heard, also where the shell that runs the tests ignores it in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("listening")
def test_ctrl_c_waits_until_the_files_are_there(tmp_path):
    with pytest.raises(KeyboardInterrupt), uninterrupted():
        os.kill(os.getpid(), signal.SIGINT)
        (tmp_path / "first").write_text("")
        (tmp_path / "second").write_text("")
    assert len(list(tmp_path.iterdir())) == 2
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_error_is_not_hidden_and_ctrl_c_that_is_ignored_stays_so():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with uninterrupted():
            os.kill(os.getpid(), signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
    with pytest.raises(ValueError, match="disk"), uninterrupted():
        raise ValueError("disk")
