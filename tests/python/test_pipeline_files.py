"""Recordings in files: what is chosen of them, and what is written."""

import doctest
import json
from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core
from dqslam.io import FileError, load_recording
from dqslam.io.step_covariances import write_step_covariances
from dqslam.pipeline import RunFilesOptions, RunOptions, run, run_files
from dqslam.simulation import perturb_odometry
from test_cli_run import PERTURB, call, report

NOISE = dq.OdometryNoise(translation_m=0.01, rotation_rad=0.01)
NOISY = RunFilesOptions(added_noise=NOISE, seed=1)
WALL_CLOCK = {"seconds", "step_ms_median", "step_ms_p99", "step_ms_worst", "total_s"}


def without_times(content):
    """Leave the wall clock out of a report."""
    if isinstance(content, dict):
        return {key: without_times(one) for key, one in content.items() if key not in WALL_CLOCK}
    return content


@pytest.mark.parametrize(
    ("words", "chosen", "online"),
    [
        (("--ids", "none", "--hold-out", "0.25"), {"ids": "none", "hold_out": 0.25}, False),
        (("--trust-ids", "0.8", "--online"), {"trust_ids": 0.8}, True),
        (("--mode", "mapping", "--min-score", "0.1"), {"mode": _core.Mode.MAPPING}, False),
    ],
)
def test_writes_what_the_command_writes(files, tmp_path, words, chosen, online):
    code = call(files, *PERTURB, "--seed", "1", *words)
    assert code == (3 if report(files)["doubts"] else 0)
    chosen = {"min_score": 0.1 if "mode" in chosen else 0.5, **chosen}
    options = RunFilesOptions(added_noise=NOISE, seed=1, **chosen)
    result = run_files(*files, options, online=online, out=tmp_path / "mine")
    theirs = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    ours = {path.name: path.read_bytes() for path in (tmp_path / "mine").iterdir()}
    assert theirs.keys() - ours.keys() == {"config.toml"}
    for name in ours.keys() - {"report.json", "manifest.json"}:
        assert ours[name] == theirs[name], name
    written = json.loads(ours["report.json"])
    assert without_times(written) == without_times(report(files))
    assert list(written) == list(report(files)) == list(result.report)
    assert written["trajectory_error"] == result.report["trajectory_error"]


def test_is_a_run_of_the_recording_that_it_reads(files, orbit):
    recording, _ = load_recording(*files, ids="none", final_ids=False, odometry_noise=NOISE)
    expected = run(perturb_odometry(recording, NOISE, seed=1), RunOptions(seed=1, hold_out=0.1))
    options = RunFilesOptions(ids="none", hold_out=0.1, added_noise=NOISE, seed=1)
    result = run_files(*files, options)
    np.testing.assert_array_equal(result.estimate.poses, expected.estimate.poses)
    np.testing.assert_array_equal(result.detections.object_id, expected.detections.object_id)
    assert expected.report.items() >= {"poses": 40, "mode": "slam"}.items()
    assert expected.report["trajectory_error"] is None  # but the files know the way before
    assert result.report["reference"] == "odometry before the added noise"
    assert result.report["trajectory_error"]["poses"] == len(orbit.times)
    assert [path for path in files[0].parent.iterdir() if path.is_dir()] == []


def test_the_noise_is_estimated_where_nothing_is_said_of_it(files):
    def source(**chosen):
        return run_files(*files, RunFilesOptions(**chosen)).report["odometry_noise"]["from"]

    assert source() == "estimated"
    assert source(odometry_noise=NOISE) == "given"
    assert source(odometry_noise=NOISE, estimates_noise=True) == "estimated"


def test_what_is_believed_of_a_step_is_what_is_said_last(files):
    """A file of covariances, else a noise of all steps, else the noise that was added."""
    large = dq.OdometryNoise(0.5, 0.1)
    assert RunFilesOptions().believed_noise is None
    assert NOISY.believed_noise == NOISE
    assert replace(NOISY, odometry_noise=large).believed_noise == large
    steps = files[0].parent / "steps.csv"
    write_step_covariances(steps, load_recording(*files, odometry_noise=large)[0])
    both = replace(NOISY, odometry_noise=large, odometry_covariance=steps)
    assert both.believed_noise is None
    expected = run_files(*files, replace(NOISY, odometry_noise=large))
    result = run_files(*files, both)
    np.testing.assert_allclose(result.estimate.poses, expected.estimate.poses, atol=1e-6)
    assert result.report["odometry_noise_believed"] is None
    assert result.report["odometry_covariance"] == str(steps)


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        (0, "{", "camera.json:1: not JSON"),
        (1, "100.0 1 2 3 0 0 0 x", "traj.txt:1: qw is 'x', not a number"),
        (2, "frame\n", "boxes.csv:1: no column"),
    ],
)
def test_a_bad_file_is_named_and_leaves_no_directory(files, file, text, message):
    files[file].write_text(text)
    out = files[0].parent / "deep" / "out"
    with pytest.raises(FileError, match=message):
        run_files(*files, out=out)
    assert not out.parent.exists()


def test_what_a_session_refuses_leaves_no_directory(files):
    out = files[0].parent / "out"
    with pytest.raises(ValueError, match="no mode MAPPING"):
        run_files(*files, RunFilesOptions(mode=_core.Mode.MAPPING), online=True, out=out)
    assert not out.exists()


def test_texts_are_written_beside_the_results(files):
    out = files[0].parent / "out"
    run_files(*files, NOISY, out=out, beside={"notes.txt": "mine\n"})
    assert (out / "notes.txt").read_text() == "mine\n"


@pytest.mark.parametrize("function", [run, run_files])
def test_the_examples_are_true(function, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (test,) = doctest.DocTestFinder(recurse=False).find(function, globs={})
    assert doctest.DocTestRunner().run(test).failed == 0
    assert len(test.examples) >= 5
