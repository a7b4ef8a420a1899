"""Batches whose recordings are run by a quick program in place of ``dqslam run``."""

import json
import os

import pytest

from dqslam.io.files import FileError
from dqslam.studies.batch import Task, run_batch
from dqslam.studies.batch import store as store_module
from dqslam.studies.batch import task as task_module
from dqslam.studies.batch.store import Store
from dqslam.studies.batch.task import why

# It writes what the table needs. `seed` is the number of poses; with some, the run fails.
QUICK = """\
import json, os, signal, sys, tomllib
from pathlib import Path
from dqslam._outputs import output_set

with open(sys.argv[-2], "rb") as file:
    asked = tomllib.load(file)
poses = asked["seed"]
log = Path(asked["out"]).parents[1] / "log.txt"
with log.open("a") as file:
    file.write(Path(asked["out"]).name + "\\n")
if poses == 13:
    print("dqslam: boxes.csv:7: no number", file=sys.stderr)
    sys.exit(2)
if poses == 14:
    os.kill(os.getpid(), signal.SIGKILL)
report = {
    "doubts": ["the map is empty"] if poses == 15 else [], "warnings": ["a", "b"],
    "poses": poses, "keyframes": 1, "boxes": {"count": 5}, "objects": [{}, {}],
    "dropped_objects": {"3": "moved"}, "box_noise": {"pixels": 2.0, "relative": 0.05},
    "odometry_noise": {"from": "given"}, "trajectory_error": None,
    "reprojection": {"iou_median": 0.5},
}
with output_set(asked["out"], "dqslam run") as folder:
    (folder / "report.json").write_text(json.dumps(report))
sys.exit(3 if report["doubts"] else 0)
"""


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(task_module, "_PROGRAM", QUICK)


@pytest.fixture
def call(tmp_path):
    """Run recordings by name and number of poses, and return the batch and what was run."""

    def call(**poses):
        log = tmp_path / "out" / "log.txt"
        log.unlink(missing_ok=True)
        boxes = tmp_path / "boxes.csv"
        if not boxes.exists():
            boxes.touch()
        tasks = [Task(name, {"seed": count, "detections": boxes}) for name, count in poses.items()]
        done = run_batch(tasks, tmp_path / "out", jobs=1)
        return done, log.read_text().split() if log.exists() else []

    return call


def test_a_row_for_each_and_failures_stop_nobody(call):
    done, ran = call(a=13, b=20, c=14, d=15)
    assert ran == ["a", "b", "c", "d"]
    assert (done.done, done.found) == (4, 0)
    assert [(row.name, row.status, row.exit_code) for row in done.rows] == [
        ("a", "failed", 2),
        ("b", "done", 0),
        ("c", "failed", -9),
        ("d", "doubtful", 3),
    ]
    first, second, third, fourth = done.rows
    assert first.error == "boxes.csv:7: no number"
    assert third.error == "its process was ended by signal 9 (SIGKILL)"
    assert (first.poses, second.poses, third.poses, fourth.poses) == (None, 20, None, 15)
    assert (second.objects, second.warnings, second.dropped_objects) == (2, 2, 1)
    assert (second.doubts, fourth.doubts) == (None, "the map is empty")
    assert second.ate_m is second.odometry_translation_m is None
    assert second.seconds > 0.0


def test_only_what_has_failed_or_changed_is_run_again(call, tmp_path):
    call(a=13, b=20, c=15)
    assert call(a=13, b=20, c=15)[1] == ["a"]
    done, ran = call(a=21, b=22, c=15, d=23)
    assert (ran, done.done, done.found) == (["a", "b", "d"], 3, 1)
    assert [row.poses for row in done.rows] == [21, 22, 15, 23]
    os.utime(tmp_path / "boxes.csv", ns=(1, 1))
    assert call(a=21, b=22, c=15)[1] == ["a", "b", "c"]
    assert call(b=22)[1] == []
    (tmp_path / "out" / "recordings" / "b" / "manifest.json").unlink()
    (tmp_path / "out" / "recordings" / "b" / "report.json").unlink()
    assert call(a=21, b=22)[1] == ["b"]


def test_a_failed_recording_does_not_show_earlier_results(call):
    call(a=20)
    done, _ = call(a=13)
    assert (done.rows[0].status, done.rows[0].poses) == ("failed", None)
    assert call(a=20)[1] == ["a"]


def test_killed_between_the_results_and_their_record(call, tmp_path):
    """Nothing is run again then; the exit code is that of the report, the time is not known."""
    call(a=20, b=15)
    for name in "ab":
        path = tmp_path / "out" / "runs" / f"{name}.json"
        record = json.loads(path.read_text()) | {"exit_code": None, "seconds": None}
        path.write_text(json.dumps(record))
    done, ran = call(a=20, b=15)
    assert ran == []
    assert [(row.exit_code, row.seconds) for row in done.rows] == [(0, None), (3, None)]


def test_killed_before_new_results_replaced_the_old_ones(call, tmp_path):
    call(a=20)
    store = Store(tmp_path / "out")
    task = Task("a", {"seed": 24, "detections": tmp_path / "boxes.csv"})
    store.begin("a", task.plain, task.files)
    done, ran = call(a=24)
    assert (ran, done.rows[0].poses) == (["a"], 24)


def test_a_torn_record_or_one_of_another_version_is_run_again(call, tmp_path, monkeypatch):
    call(a=20, b=21)
    (tmp_path / "out" / "runs" / "a.json").write_text('{"name": "a"')
    assert call(a=20, b=21)[1] == ["a"]
    monkeypatch.setattr(store_module, "version", lambda: "9.9.9")
    assert call(a=20, b=21)[1] == ["a", "b"]


def test_the_table_is_the_same_as_csv_and_as_parquet(call, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    done, _ = call(a=13, b=20)
    table = parquet.read_table(tmp_path / "out" / "results.parquet")
    assert table.to_pylist() == [vars(row) for row in done.rows]
    # Empty columns have their types, so that tables of several batches fit together.
    assert {str(table.schema.field(name).type) for name in ("ate_m", "seconds")} == {"double"}
    assert str(table.schema.field("poses").type) == "int64"
    assert str(table.schema.field("doubts").type) == "string"
    lines = (tmp_path / "out" / "results.csv").read_text().splitlines()
    assert lines[0].split(",") == table.column_names
    assert lines[1].startswith("a,failed,2,")
    assert lines[1].endswith(",boxes.csv:7: no number")


def test_folders_count_with_all_that_is_in_them(tmp_path):
    store, labels = Store(tmp_path / "out"), tmp_path / "labels"
    labels.mkdir()
    (labels / "1.txt").write_text("0 1 2")
    before = store.begin("a", {}, [labels]).files
    assert before[str(labels)][:2] == [1, 5]
    (labels / "2.txt").write_text("0")
    after = store.begin("a", {}, [labels]).files
    assert after[str(labels)][:2] == [2, 6]


def test_what_is_no_batch_is_refused(tmp_path):
    with pytest.raises(ValueError, match="there is no recording"):
        run_batch([], tmp_path / "out")
    with pytest.raises(ValueError, match="2 recordings have the name a"):
        run_batch([Task("a"), Task("a")], tmp_path / "out")
    with pytest.raises(ValueError, match=r"'\.\./a' is not a name that a folder may have"):
        Task("../a")
    with pytest.raises(ValueError, match="the batch chooses the folders"):
        Task("a", {"out": "x"})
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "note.txt").write_text("")
    with pytest.raises(FileError, match="is there already, and not empty"):
        run_batch([Task("a")], tmp_path / "mine", jobs=1)


@pytest.mark.parametrize(
    ("code", "said", "reason"),
    [
        (
            2,
            "warning: x\ndqslam: f.toml:1: no\ndqslam: f.toml:2: no\n",
            "f.toml:1: no; f.toml:2: no",
        ),
        (1, "Traceback ...\n  File\nKeyError: 'x'\n\n", "KeyError: 'x'"),
        (1, "", "exit code 1"),
        (-11, "", "its process was ended by signal 11 (SIGSEGV)"),
    ],
)
def test_why_a_run_failed(code, said, reason):
    assert why(code, said) == reason
