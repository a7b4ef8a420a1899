import json

import numpy as np
import pytest

from console import assert_one_line_of_error
from dqslam.assumptions import OdometryNoise
from dqslam.cli import main
from dqslam.cli.run import parse_noise
from dqslam.io import read_trajectory
from orbit import NAMES

PERTURB = ("--perturb-odometry", "translation=0.01,rotation=0.01")


def call(files, *more):
    camera, odometry, detections = map(str, files)
    out = str(files[0].parent / "out")
    names = ("--camera", camera, "--odometry", odometry, "--detections", detections, "--out", out)
    return main(["run", *names, *more])


def report(files):
    return json.loads((files[0].parent / "out" / "report.json").read_text())


def test_writes_what_it_says(files, orbit, capsys):
    assert call(files, *PERTURB, "--seed", "1", "--ids", "class_id") == 0
    out = files[0].parent / "out"
    assert sorted(path.name for path in out.iterdir()) == [
        "boxes.csv",
        "camera.json",
        "config.toml",
        "covariance.csv",
        "graph.npz",
        "manifest.json",
        "map.json",
        "odometry.txt",
        "report.json",
        "trajectory.txt",
    ]
    for name in ("trajectory.txt", "odometry.txt"):
        times, poses = read_trajectory(out / name)
        np.testing.assert_array_equal(times, orbit.times)
        np.testing.assert_allclose(poses[0], orbit.poses[0], atol=1e-8)
    error = report(files)["trajectory_error"]
    for name, when in (("trajectory.txt", "after"), ("odometry.txt", "before")):
        _, poses = read_trajectory(out / name)
        mean = np.linalg.norm(poses[:, :3] - orbit.poses[:, :3], axis=1).mean()
        assert error[when]["mean_m"] == pytest.approx(mean, abs=1e-7)
    assert error["after"]["ate_rmse_m"] < 0.4 * error["before"]["ate_rmse_m"]
    shown = capsys.readouterr()
    assert shown.err == ""
    assert f"odometry {error['before']['mean_m']:.4f} m" in shown.out
    assert "better" in shown.out


def test_the_map_has_the_objects(files, orbit):
    assert call(files, "--mode", "mapping") == 0
    objects = json.loads((files[0].parent / "out" / "map.json").read_text())["objects"]
    assert [entry["id"] for entry in objects] == [name + 100 for name in NAMES]
    assert [entry["class_name"] for entry in objects] == list(NAMES.values())
    for entry in objects:
        name = entry["id"] - 100
        np.testing.assert_allclose(entry["center"], orbit.centers[name], atol=0.01)
        np.testing.assert_allclose(
            entry["semi_axes"], sorted(orbit.semi_axes[name], reverse=True), atol=0.02
        )
        assert entry["observations"] == len(orbit.times)
        quadric = np.array(entry["dual_quadric"])
        assert quadric[3, 3] == 1
        np.testing.assert_allclose(quadric[:3, 3], entry["center"])


def test_sizes_of_classes_are_read_and_checked(files, tmp_path, capsys):
    sizes = tmp_path / "sizes.toml"
    sizes.write_text("[classes.cup]\nmedian_m = 0.05\nspread = 1.5\n")
    assert call(files, "--size-priors", str(sizes), "--mode", "mapping") == 0
    cup = report(files)["size_prior"]["classes"]["cup"]
    assert cup == pytest.approx({"median_m": 0.05, "log_sigma": np.log(1.5)})
    sizes.write_text("[classes.sofa]\nmedian_m = 1\nspread = 1.5\n")
    capsys.readouterr()
    assert call(files, "--size-priors", str(sizes)) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "no class 'sofa' in the recording, only: " in line
    assert call(files, "--size-priors", str(tmp_path / "none.toml")) == 2
    assert "none.toml" in capsys.readouterr().err


def test_report_names_the_settings_and_what_was_dropped(files):
    assert call(files, *PERTURB, "--seed", "7", "--odometry-noise", "translation=1,rotation=2") == 0
    content = report(files)
    assert content["odometry_noise_added"] == {
        "translation_m": 0.01,
        "rotation_rad": 0.01,
        "seed": 7,
    }
    assert content["odometry_noise_believed"] == {"translation_m": 1.0, "rotation_rad": 2.0}
    assert content["dropped_boxes"]["below_min_score"] == 0
    assert content["reference"] == "odometry before the added noise"
    assert (content["poses"], content["boxes"]["count"]) == (40, 160)


def test_json_is_the_report(files, capsys):
    assert call(files, *PERTURB, "--json") == 0
    assert json.loads(capsys.readouterr().out) == report(files)


def test_the_covariance_of_each_step_may_be_given(files, orbit, capsys):
    """The same as one noise for all, where that is what it says."""
    count = len(orbit.times)
    upper = [0.01**2 if row == column else 0 for row in range(6) for column in range(row, 6)]
    names = [f"c{row}{column}" for row in range(1, 7) for column in range(row, 7)]
    rows = [[repr(float(time)), *map(str, upper)] for time in orbit.times[1:]]
    path = files[0].parent / "steps.csv"
    path.write_text("\n".join(",".join(row) for row in [["timestamp", *names], *rows]) + "\n")
    given = ("--odometry-covariance", str(path))
    assert call(files, *given) == 0
    assert report(files)["odometry_noise"] == {"from": "given"}
    written = (files[0].parent / "out" / "trajectory.txt").read_bytes()
    assert call(files, "--odometry-noise", "translation=0.01,rotation=0.01") == 0
    assert (files[0].parent / "out" / "trajectory.txt").read_bytes() == written
    assert len(rows) == count - 1
    capsys.readouterr()
    assert call(files, *given, "--odometry-noise", "translation=0.01,rotation=0.01") == 2
    assert "--odometry-covariance: another option gives the noise" in capsys.readouterr().err


def test_without_truth_no_error_is_claimed(files, capsys):
    assert call(files) == 0
    assert report(files)["trajectory_error"] is None
    assert "unknown" in capsys.readouterr().out


def test_groundtruth_file_is_the_reference(files):
    truth = files[0].parent / "truth.txt"
    truth.write_text(files[1].read_text())
    assert call(files, *PERTURB, "--groundtruth", str(truth)) == 0
    from_file = report(files)
    assert from_file["reference"] == "file"
    assert call(files, *PERTURB) == 0
    assert report(files)["trajectory_error"] == from_file["trajectory_error"]


def test_same_seed_same_files(files):
    contents = []
    for _ in range(2):
        assert call(files, *PERTURB, "--seed", "5") == 0
        out = files[0].parent / "out"
        contents.append([(out / name).read_bytes() for name in ("trajectory.txt", "map.json")])
    assert contents[0] == contents[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--camera", "none.json"), "none.json: no such file"),
        (("--odometry", "none.txt"), "none.txt: no such file"),
        (("--detections", "none.csv"), "none.csv: no such file"),
        (("--groundtruth", "none.txt"), "none.txt: no such file"),
        (("--min-score", "1.5"), "min_score is 1.5, not between 0 and 1"),
        (("--min-score", "0.95"), "no object is left of 160 boxes"),
        (("--ids", "name"), "'--ids'"),
        (("--perturb-odometry", "0.02,0.01"), 'is not like "translation='),
        (("--perturb-odometry", "translation=0.02"), 'is not like "translation='),
        (("--perturb-odometry", "translation=a,rotation=1"), 'is not like "translation='),
        (("--odometry-noise", "translation=0,rotation=1"), "translation is 0, not between"),
        (("--odometry-noise", "translation=1,rotation=nan"), "rotation is nan, not between"),
        (("--seed", "-1"), "'--seed'"),
        (("--hold-out", "1"), "'--hold-out'"),
        (("--trust-ids", "0.4"), "'--trust-ids'"),
        (("--trust-ids", "0.5"), "trust in ids is 0.5, not above 0.5 and at most 1"),
        (("--format", "zip"), "zip"),
    ],
)
def test_bad_arguments_are_one_line_and_code_2(files, capsys, arguments, message):
    assert call(files, *arguments) == 2
    assert_one_line_of_error(capsys, message)


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (0, '"fx": 500.0', '"fx": -500.0', "camera.json:1: fx is -500, not positive"),
        (0, '"fx": 500.0, ', "", "camera.json: missing fx"),
        (0, "}", "", "camera.json:1: not JSON"),
        (1, "\n100.1 ", "\n99.1 ", "traj.txt:2: time 99.1 goes back from 100.0 (line 1)"),
        (1, "\n100.1 ", "\n100.0 ", "traj.txt:2: time 100.0 repeats 100.0"),
        (1, "\n100.1 ", "\n100.1 nan ", "traj.txt:2: 9 fields, not 8"),
        (2, ",x2,", ",east,", "boxes.csv:1: no column x2"),
        (2, "\n0,100.0,", "\n0,now,", "boxes.csv:2: timestamp is 'now', not a number"),
        (2, ",0.9,1,cup,101\n1,", ",0.9,1,cup\n1,", "fields, but 10 columns"),
    ],
)
def test_bad_files_are_one_line_and_code_2(files, capsys, file, old, new, message):
    text = files[file].read_text()
    assert old in text
    files[file].write_text(text.replace(old, new, 1))
    assert call(files) == 2
    assert_one_line_of_error(capsys, message)


def test_an_output_that_is_a_file(files, capsys):
    (files[0].parent / "out").write_text("mine")
    assert call(files) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert (files[0].parent / "out").read_text() == "mine"


def test_parse_noise():
    assert parse_noise("--x", "rotation=0.5, translation=1e-2") == OdometryNoise(0.01, 0.5)
    assert parse_noise("--x", None) is None


# --- without ids, boxes held out, and nothing to map


def test_without_ids(files, orbit, capsys):
    assert call(files, *PERTURB, "--seed", "1", "--ids", "none", "--hold-out", "0.25") == 0
    content = report(files)
    assert (content["ids"], content["trust_ids"]) == ("none", None)
    assert len(content["objects"]) == len(NAMES)
    error = content["trajectory_error"]
    assert error["after"]["ate_rmse_m"] < 0.5 * error["before"]["ate_rmse_m"]
    tested = content["reprojection"]
    assert (tested["boxes"], tested["held_out"], tested["explained_share"]) == (40, True, 1.0)
    shown = capsys.readouterr().out
    assert f"median IoU {tested['iou_median']:.2f} of the boxes held out; 100% of those" in shown


def test_ids_that_are_not_final(files):
    assert call(files, *PERTURB, "--trust-ids", "0.9") == 0
    content = report(files)
    assert content["trust_ids"] == 0.9
    assert [entry["id"] for entry in content["objects"]] == [0, 1, 2, 3]


def test_the_level_of_the_noise_is_estimated_unless_it_is_known(files, capsys):
    assert call(files) == 0
    noise = report(files)["odometry_noise"]
    assert noise["from"] == "estimated"
    line = f"estimated: {1e3 * noise['translation_m']:.2f} mm"
    assert line in capsys.readouterr().out
    assert call(files, *PERTURB) == 0
    assert report(files)["odometry_noise"] == {"from": "given"}


@pytest.mark.parametrize("ids", ["none", "track_id"])
def test_nothing_at_rest_is_said(files, capsys, ids):
    lines = files[2].read_text().splitlines()
    random = np.random.default_rng(0)
    for row in range(1, len(lines)):
        cells = lines[row].split(",")
        x, y = random.uniform([0, 0], [500, 400]).tolist()
        cells[2:6] = map(repr, (x, y, x + 60, y + 60))
        lines[row] = ",".join(cells)
    files[2].write_text("\n".join(lines) + "\n")
    assert call(files, "--ids", ids) == 3
    shown, warned = capsys.readouterr()
    assert "warning: unexplained: no reading of the files explains" in warned
    assert "warning: the map is empty, though there are 160 boxes" in warned
    assert len(report(files)["doubts"]) == 2
    assert "no object fits a world at rest: the trajectory is the odometry" in shown
    assert "no box shows an object of the map" in shown
    assert report(files)["objects"] == []
    assert ("object 101 is not in the map: no place explains its boxes" in shown) == (
        ids == "track_id"
    )
    out = files[0].parent / "out"
    estimate, odometry = (
        read_trajectory(out / name)[1] for name in ("trajectory.txt", "odometry.txt")
    )
    np.testing.assert_array_equal(estimate, odometry)


def test_frames_without_times(files, orbit):
    """YOLO and MOT count frames: the rate tells their times."""
    mot = files[0].parent / "det.txt"
    rows = []
    for (pose, name), box in orbit.boxes.items():
        x1, y1, x2, y2 = box.tolist()
        rows.append(f"{pose + 1},{name},{x1!r},{y1!r},{x2 - x1!r},{y2 - y1!r},0.9,1,1")
    mot.write_text("\n".join(rows) + "\n")
    times = files[0].parent / "times.txt"
    times.write_text("".join(f"{time!r}\n" for time in orbit.times.tolist()))
    more = ("--format", "mot", "--frame-times", str(times), "--mode", "mapping")
    assert call((files[0], files[1], mot), *more) == 0
    content = report(files)
    assert content["boxes"]["count"] == 160
    assert [entry["id"] for entry in content["objects"]] == list(NAMES)
