"""The examples in the docstrings of the names that users begin with are run."""

import doctest

import pytest

import dqslam as dq

EXPLAINED = [
    dq.load_scenario,
    dq.simulate,
    dq.Recording,
    dq.Odometry.from_poses,
    dq.Detections.from_xyxy,
    dq.load_recording,
    dq.build_graph,
    dq.solve,
    dq.Estimate,
    dq.evaluate,
    dq.save_estimate,
    dq.load_results,
    dq.associate,
    dq.OnlineSlam,
]


@pytest.mark.parametrize("explained", EXPLAINED, ids=lambda one: one.__qualname__)
def test_examples(explained, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)  # examples write files
    # A bound method has a docstring that only its function is asked for.
    function = getattr(explained, "__func__", explained)
    (test,) = doctest.DocTestFinder(recurse=False).find(function, "example", globs={})
    result = doctest.DocTestRunner().run(test)
    assert result.failed == 0, capsys.readouterr().out
    assert result.attempted >= 3
