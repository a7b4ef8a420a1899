"""The directory of results: made before the work, gone with it, written whole."""

import os
import signal

import pytest

from dqslam._files import results_directory, uninterrupted


def test_a_directory_that_stays_empty_goes_again(tmp_path):
    deep = tmp_path / "a" / "b"
    with pytest.raises(KeyboardInterrupt), results_directory(deep):
        assert deep.is_dir()
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_what_was_there_or_has_files_stays(tmp_path):
    (tmp_path / "a").mkdir()
    with pytest.raises(ValueError, match="x"), results_directory(tmp_path / "a"):
        raise ValueError("x")
    assert (tmp_path / "a").is_dir()
    with pytest.raises(ValueError, match="x"), results_directory(tmp_path / "b" / "c"):
        (tmp_path / "b" / "c" / "file").write_text("")
        raise ValueError("x")
    assert (tmp_path / "b" / "c" / "file").exists()


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
