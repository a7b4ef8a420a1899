"""What an answer is worth, and how programs are run to get one. Nothing asserts a time."""

import sys

import numpy as np
import pytest
from benchmarks import measure
from benchmarks.exchange import Stopwatch, peak_memory_mb, write_answer
from benchmarks.problems import BOX_SIGMA_PX
from benchmarks.score import score

from bench import tiny, true_quadrics


def test_score_of_the_truth():
    problem = tiny()
    found = score(problem, problem.truth.poses, true_quadrics(problem))
    assert (found.rmse_m, found.aligned_rmse_m) == (0.0, pytest.approx(0.0, abs=1e-12))
    assert found.center_rmse_m == pytest.approx(0.0, abs=1e-12)
    assert found.box_rms_px == pytest.approx(BOX_SIGMA_PX, rel=0.15)
    assert found.impossible_boxes == 0


def test_score_by_hand():
    problem = tiny()
    poses, quadrics = problem.truth.poses.copy(), true_quadrics(problem)
    poses[:, :2] += [3.0, 4.0]
    quadrics[0, [0, 4, 7]] += 100.0  # no ellipsoid any more
    first = problem.recording.detections.object_id == 0
    found = score(problem, poses, quadrics)
    assert found.rmse_m == pytest.approx(5.0)
    assert found.aligned_rmse_m == pytest.approx(0.0, abs=1e-9)
    assert found.impossible_boxes >= first.sum() > 0


def test_an_answer_of_another_size_is_refused():
    problem = tiny()
    with pytest.raises(ValueError, match=r"expected 60 poses and \d objects, got 59 and \d"):
        score(problem, problem.truth.poses[1:], true_quadrics(problem))


def test_programs_take_turns_and_one_that_fails_is_not_repeated(tmp_path):
    problem = tiny()
    stopwatch = Stopwatch()
    with stopwatch("solve"):
        pass
    prepared = tmp_path / "prepared.npz"
    write_answer(
        str(prepared),
        problem.truth.poses,
        true_quadrics(problem),
        stopwatch,
        iterations=3,
        cost=2.5,
    )
    copies = [
        sys.executable,
        "-c",
        f"import shutil, sys; shutil.copy({str(prepared)!r}, sys.argv[2])",
    ]
    fails = [sys.executable, "-c", "raise SystemExit('no such luck')"]
    said = []
    good, bad = measure.measure(
        "tiny",
        problem,
        {"good": copies, "bad": fails},
        repeat=2,
        limit_s=60.0,
        progress=said.append,
    )
    assert said == ["tiny: good, run 1 of 2", "tiny: bad, run 1 of 2", "tiny: good, run 2 of 2"]
    assert good.failure == ""
    assert [(run.iterations, run.cost, run.score.rmse_m) for run in good.runs] == [
        (3, 2.5, 0.0)
    ] * 2
    assert bad.failure == "no such luck"
    assert good.size == {
        "poses": 60,
        "objects": len(true_quadrics(problem)),
        "boxes": good.size["boxes"],
    }


def test_a_run_over_the_limit_fails(tmp_path):
    sleeps = [sys.executable, "-c", "import time; time.sleep(60)"]
    run = measure.run_once(sleeps, tiny(), tmp_path / "problem", tmp_path / "answer", limit_s=0.2)
    assert run.failure == "not done within 0.2 s"


def test_peak_memory_sees_an_array():
    before = peak_memory_mb()
    held = np.ones(20_000_000)
    assert peak_memory_mb() >= before
    assert peak_memory_mb() > held.nbytes / 2**20


def test_stopwatch_adds_up():
    stopwatch = Stopwatch()
    for _ in range(2):
        with stopwatch("solve"):
            pass
    assert list(stopwatch.stages) == ["solve"]
    assert stopwatch.stages["solve"]["wall_s"] > 0.0
