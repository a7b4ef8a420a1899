"""``dqslam run --online``: a recording replayed step by step."""

import numpy as np

from dqslam.io import load_results
from test_cli_run import PERTURB, call, report


def test_writes_what_a_run_writes(files, orbit, capsys):  # noqa: F811
    assert call(files, *PERTURB, "--seed", "1", "--ids", "class_id", "--online") == 0
    results = load_results(files[0].parent / "out")
    np.testing.assert_array_equal(results.timestamps, orbit.times)
    assert sorted(results.objects.object_ids) == sorted(orbit.centers)
    assert np.isfinite(results.objects.center_covariances).all()
    assert np.isfinite(results.covariances[1:]).all()
    said = report(files)
    error = said["trajectory_error"]
    assert error["after"]["ate_rmse_m"] < 0.4 * error["before"]["ate_rmse_m"]
    assert error["live"]["ate_rmse_m"] <= 1.5 * error["after"]["ate_rmse_m"]
    assert said["online"]["step_ms_worst"] >= said["online"]["step_ms_median"] > 0.0
    assert said["boxes"]["unassigned"] == 0
    assert f"{len(orbit.times)}, {len(orbit.times)} of them keyframes" in capsys.readouterr().out


def test_finds_objects_without_ids(files, orbit):  # noqa: F811
    assert call(files, *PERTURB, "--seed", "1", "--ids", "none", "--online") == 0
    said = report(files)
    assert len(said["objects"]) == len(orbit.centers)
    error = said["trajectory_error"]
    assert error["after"]["ate_rmse_m"] < 0.5 * error["before"]["ate_rmse_m"]
    assert error["live"]["ate_rmse_m"] < 0.5 * error["before"]["ate_rmse_m"]


def test_boxes_held_out_are_not_seen(files):  # noqa: F811
    call(files, *PERTURB, "--seed", "1", "--ids", "none", "--online", "--hold-out", "0.25")
    said = report(files)
    tested = said["reprojection"]
    assert tested["held_out"]
    assert tested["boxes"] == round(0.25 * (tested["boxes"] + _seen(said)))
    assert tested["explained_share"] > 0.9


def _seen(said):
    boxes = said["boxes"]
    return boxes["count"] + boxes["of_dropped_objects"] + boxes["unassigned"]


def test_the_noise_is_estimated_by_default(files):  # noqa: F811
    assert call(files, "--ids", "none", "--online") == 0
    assert report(files)["odometry_noise"]["from"] == "estimated"


def test_goes_not_with_mapping(files, capsys):  # noqa: F811
    assert call(files, "--online", "--mode", "mapping") == 2
    assert "--online: cannot be combined with --mode mapping" in capsys.readouterr().err
