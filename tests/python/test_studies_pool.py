import multiprocessing
import os
import signal
import subprocess
import sys
import time
import types
from contextlib import closing
from importlib.machinery import ModuleSpec

import pytest
from joblib import register_parallel_backend
from joblib._parallel_backends import ThreadingBackend

from dqslam.studies.pool import run_each

HERE = ("processes", "loky")


@pytest.mark.parametrize("backend", ["serial", *HERE])
def test_each_item_is_given_once(backend):
    given = list(run_each(abs, [-1, 2, -3], jobs=2, backend=backend))
    assert sorted(given) == [1, 2, 3]


@pytest.mark.parametrize("backend", ["serial", *HERE])
def test_there_may_be_nothing_to_do(backend):
    assert list(run_each(abs, [], jobs=2, backend=backend)) == []


def test_one_job_needs_no_other_process():
    assert list(run_each(lambda _: os.getpid(), range(3), jobs=1)) == [os.getpid()] * 3


@pytest.mark.parametrize("backend", HERE)
def test_items_run_in_other_processes_with_one_thread_each(backend):
    name = "OPENBLAS_NUM_THREADS"
    assert set(run_each(os.getenv, [name] * 3, jobs=2, backend=backend)) == {"1"}
    assert os.getpid() not in run_each(_process, range(3), jobs=2, backend=backend)


def _process(_):
    return os.getpid()


@pytest.mark.parametrize("backend", ["serial", *HERE])
def test_an_error_comes_out(backend):
    with pytest.raises(ZeroDivisionError):
        list(run_each((1).__truediv__, [1, 0, 1], jobs=2, backend=backend))


def test_an_error_in_a_process_stops_the_others():
    with pytest.raises(ZeroDivisionError):
        list(run_each((1).__truediv__, [1, 0, 1], jobs=2, backend="processes"))
    assert not multiprocessing.active_children()


@pytest.mark.parametrize("backend", HERE)
@pytest.mark.filterwarnings("error")
def test_who_has_enough_stops_without_a_word(backend, capfd):
    with closing(run_each(abs, range(100), jobs=2, backend=backend)) as results:
        assert next(results) >= 0
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("backend", HERE)
def test_a_process_that_dies_ends_the_run(backend):
    with pytest.raises(RuntimeError):  # both pools' errors derive from it
        list(run_each(os._exit, [3], jobs=2, backend=backend))


@pytest.mark.parametrize("backend", HERE)
def test_processes_end_after_a_parent_that_is_killed(backend, tmp_path):
    code = (
        "import os, time; from dqslam.studies.pool import run_each\n"
        "if __name__ == '__main__':\n"
        f"    for pid in run_each(os.readlink, ['/proc/self'] * 4, jobs=2, backend={backend!r}):\n"
        "        print(pid, flush=True)\n"
        "    time.sleep(60)\n"
    )
    script = tmp_path / "script.py"
    script.write_text(code)
    parent = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    pids = {int(parent.stdout.readline()) for _ in range(4)}
    if backend == "loky":  # the other pool has ended its own by now
        assert all(os.path.exists(f"/proc/{pid}") for pid in pids)
    parent.send_signal(signal.SIGKILL)
    parent.wait(timeout=60)
    parent.stdout.close()
    deadline = time.monotonic() + 30.0
    while any(os.path.exists(f"/proc/{pid}") for pid in pids):
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"jobs": 0}, "jobs: expected 1 or more, got 0"),
        ({"backend": "magic"}, "backend: 'magic' is none of serial, processes, loky, dask, ray"),
        ({"backend": "loky", "scheduler": "tcp://x:1"}, "scheduler: backend loky has none"),
        ({"scheduler": "tcp://x:1"}, "scheduler: backend loky has none; choose dask or ray"),
        ({"backend": "ray"}, "backend: ray needs ray, missing: pip install ray"),
    ],
)
def test_bad_settings_are_refused_before_anything_starts(settings, message):
    with pytest.raises(ValueError, match=message):
        run_each(abs, [1], **settings)


@pytest.mark.parametrize(
    ("backend", "missing", "message"),
    [
        ("loky", "joblib", r"loky needs joblib, missing: pip install 'dqslam\[cluster\]'"),
        ("dask", "distributed", r"dask needs distributed, missing: pip install 'dqslam"),
    ],
)
def test_a_missing_extra_is_named(monkeypatch, backend, missing, message):
    monkeypatch.setattr(
        "dqslam.studies.pool.find_spec", lambda name: None if name == missing else name
    )
    with pytest.raises(ValueError, match=message):
        run_each(abs, [1], jobs=2, backend=backend)


def test_without_joblib_there_is_a_pool_all_the_same(monkeypatch):
    monkeypatch.setattr("dqslam.studies.pool.find_spec", lambda name: None)
    running = run_each(abs, [-1, 2, -3], jobs=2)
    assert running.__name__ == "run_in_processes"
    assert sorted(running) == [1, 2, 3]


def test_a_scheduler_that_is_not_there_is_named(monkeypatch):
    import dask

    with (
        dask.config.set({"distributed.comm.timeouts.connect": 0.2}),
        pytest.raises(ValueError, match=r"scheduler: tcp://127\.0\.0\.1:9 does not answer"),
    ):
        list(run_each(abs, [1], backend="dask", scheduler="tcp://127.0.0.1:9"))


@pytest.mark.parametrize("scheduler", [None, "ray://head:10001"])
def test_ray_is_started_registered_and_given_all_items(monkeypatch, scheduler):
    """A stand-in for ray, whose joblib backend runs threads."""
    started = []

    def init(address, num_cpus):
        started.append((address, num_cpus))

    for name, content in {
        "ray": {"is_initialized": lambda: bool(started), "init": init},
        "ray.util": {},
        "ray.util.joblib": {
            "register_ray": lambda: register_parallel_backend("ray", ThreadingBackend)
        },
    }.items():
        module = types.ModuleType(name)
        module.__spec__ = ModuleSpec(name, None)
        module.__dict__.update(content)
        monkeypatch.setitem(sys.modules, name, module)
    given = list(run_each(abs, range(-50, 0), jobs=2, backend="ray", scheduler=scheduler))
    assert given == list(range(50, 0, -1))
    assert started == [(scheduler, 2 if scheduler is None else None)]
