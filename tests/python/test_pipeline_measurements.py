"""Runs with positions of objects, absolute positions and loop closures, in files."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import _core, io
from dqslam.cli import main
from dqslam.metrics import true_rows
from dqslam.uncertainty import normalized_squares

SE3 = dq.PoseModel.SE3
CENTER = np.diag([0.005, 0.01, 0.02]) ** 2
ABSOLUTE = np.array([[9e-4, 2e-4, 0.0], [2e-4, 16e-4, 1e-4], [0.0, 1e-4, 4e-4]])
CLOSURE = np.diag([0.005, 0.008, 0.004, 0.002, 0.003, 0.002]) ** 2
SEEDS = range(4)


def table(path, names, rows):
    lines = [",".join(names), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def upper(covariance):
    return covariance[np.triu_indices(len(covariance))].tolist()


def names_of(size):
    return [f"c{i + 1}{j + 1}" for i, j in zip(*np.triu_indices(size), strict=True)]


def write_files(folder, seed):
    """A simulated recording as files, with few boxes and measurements of its truth."""
    recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=seed)
    io.save_recording(recording, folder)
    io.save_truth(truth, recording, folder)
    rng = np.random.default_rng(seed)
    cameras = _core.world_from_camera(SE3, recording.camera, truth.poses)
    times = recording.timestamps
    centers = []
    for row in range(3, len(cameras), 12):
        back = _core.inverse(SE3, cameras[[row]])[0]
        for one, center in zip(truth.object_ids.tolist(), truth.centers, strict=True):
            local = _core.compose(SE3, back[None], np.array([[*center, 0, 0, 0, 1.0]]))[0, :3]
            noisy = local + rng.multivariate_normal(np.zeros(3), CENTER)
            centers.append([row, one, *noisy.tolist(), *upper(CENTER)])
    table(folder / "positions.csv", ["pose", "object", "x", "y", "z", *names_of(3)], centers)
    # The frame of the absolute positions is turned and moved.
    frame = np.array([10.0, -5.0, 2.0, 0.0, 0.0, np.sin(0.6), np.cos(0.6)])
    there = _core.compose(SE3, np.tile(frame, (len(cameras), 1)), cameras)
    absolute = [
        [
            *[times[row].item()],
            *(there[row, :3] + rng.multivariate_normal(np.zeros(3), ABSOLUTE)).tolist(),
            *upper(ABSOLUTE),
        ]
        for row in range(0, len(cameras), 3)
    ]
    table(folder / "absolute.csv", ["timestamp", "x", "y", "z", *names_of(3)], absolute)
    closures = []
    for first in range(0, len(cameras) - 70, 8):
        second = first + 70
        relative = _core.between(SE3, cameras[[first]], cameras[[second]])
        noisy = _core.plus(SE3, relative, rng.multivariate_normal(np.zeros(6), CLOSURE)[None])[0]
        ends = (first, second) if first % 16 else (second, first)
        if ends[0] > ends[1]:
            # The same covariance, but in the frame of the other end: written as measured from it.
            relative = _core.between(SE3, cameras[[second]], cameras[[first]])
            noise = rng.multivariate_normal(np.zeros(6), CLOSURE)[None]
            noisy = _core.plus(SE3, relative, noise)[0]
        closures.append([*ends, *noisy.tolist(), *upper(CLOSURE)])
    names = ["from_pose", "to_pose", "x", "y", "z", "qx", "qy", "qz", "qw", *names_of(6)]
    table(folder / "closures.csv", names, closures)
    return cameras, there


def run(folder, **extras):
    files = [folder / name for name in ("camera.json", "odometry.txt", "boxes.csv")]
    options = dq.RunFilesOptions(
        box_noise=dq.BoxNoise(pixels=1.0, relative=0.0),
        odometry_covariance=folder / "odometry_covariance.csv",
        extras=io.Extras(**{name: folder / f"{name}.csv" for name in extras}),
    )
    return dq.run_files(*files, options)


def sparse(folder, keep=12):
    """Leave the boxes of few images, so that the other measurements matter."""
    path = folder / "boxes.csv"
    header, *rows = path.read_text().splitlines()
    kept = [row for row in rows if int(row.split(",")[0]) % keep == 0]
    path.write_text("\n".join([header, *kept]) + "\n")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Errors and NEES of the poses of all seeds, without and with each kind of measurement."""
    found = {}
    for seed in SEEDS:
        folder = tmp_path_factory.mktemp(f"seed{seed}")
        cameras, there = write_files(folder, seed)
        sparse(folder)
        for kind in ("none", "positions", "absolute", "closures"):
            result = run(folder, **({} if kind == "none" else {kind: True}))
            truth = there if kind == "absolute" else cameras
            off = np.linalg.norm(result.estimate.poses[:, :3] - truth[:, :3], axis=1)
            part = np.isfinite(result.marginals.poses).all(axis=(1, 2))
            part[0] = kind == "absolute"  # otherwise the first pose is exact
            errors = _core.minus(SE3, truth[part], result.estimate.poses[part])
            nees = normalized_squares(errors, result.marginals.poses[part])
            found.setdefault(kind, []).append((off.mean(), nees.mean(), result))
    return found


@pytest.mark.parametrize(("kind", "share"), [("positions", 0.8), ("closures", 0.9)])
def test_measurements_improve_every_run(runs, kind, share):
    before = np.array([error for error, *_ in runs["none"]])
    after = np.array([error for error, *_ in runs[kind]])
    assert np.all(after < before)
    assert after.mean() < share * before.mean()


def test_absolute_positions_give_the_frame(runs):
    # 50 positions of 3 cm each: the first pose is known to less than that, and so are all others.
    assert max(error for error, *_ in runs["absolute"]) < 0.03
    for _, _, result in runs["absolute"]:
        first = result.marginals.poses[0]
        assert 1e-6 < np.trace(first[:3, :3]) < 3 * 16e-4


@pytest.mark.parametrize("kind", ["positions", "absolute", "closures"])
def test_covariances_stay_honest(runs, kind):
    nees = np.mean([nees for _, nees, _ in runs[kind]])
    assert 0.4 < nees < 1.8


def test_positions_move_objects_at_known_poses():
    """Boxes from a short arc leave the depths of objects open, which positions tell."""
    before, after, nees = [], [], []
    orbit = dq.load_scenario("orbit")
    path = orbit.path.model_copy(update={"turns": 0.1, "poses": 12})
    for seed in SEEDS:
        recording, truth = dq.simulate(orbit.model_copy(update={"path": path}), seed=seed)
        odometry = dq.Odometry.from_poses(truth.poses, covariance=1e-6 * np.eye(6))
        recording = replace(recording, odometry=odometry)
        options = dq.RunOptions(mode=dq.Mode.MAPPING, box_noise=dq.BoxNoise(1.0, 0.0))
        without = dq.run(replace(recording, positions=None), options)
        result = dq.run(recording, options)
        assert np.array_equal(result.estimate.poses, without.estimate.poses)
        for errors, each in ((before, without), (after, result)):
            rows = true_rows(each.estimate.object_ids, truth)
            off = each.estimate.centers - truth.centers[rows]
            errors += np.linalg.norm(off, axis=1).tolist()
        nees += normalized_squares(off, result.marginals.objects[:, :3, :3]).tolist()
    assert np.mean(after) < 0.8 * np.mean(before)
    assert 0.4 < np.mean(nees) < 1.8


def test_the_report_names_the_files(runs):
    report = runs["closures"][0][2].report
    assert report["measurements"]["closures"].endswith("closures.csv")
    assert report["measurements"]["positions"] is None


def test_the_command_line(tmp_path, capsys):
    write_files(tmp_path, 0)
    names = {"camera": "camera.json", "odometry": "odometry.txt", "detections": "boxes.csv"}
    words = [word for key, name in names.items() for word in (f"--{key}", str(tmp_path / name))]
    words += ["--closures", str(tmp_path / "closures.csv"), "--out", str(tmp_path / "out")]
    positions = ["--positions", str(tmp_path / "positions.csv")]
    assert main(["run", *words, *positions]) == 0
    assert main(["run", *words, *positions, "--ids", "none"]) == 2
    assert "positions: the ids of boxes must be final" in capsys.readouterr().err
    assert main(["run", *words, "--mode", "mapping"]) == 2
    assert "closures: mode MAPPING takes the poses for known" in capsys.readouterr().err
    text = (tmp_path / "positions.csv").read_text().replace("\n3,0,", "\n3,77,", 1)
    (tmp_path / "positions.csv").write_text(text)
    assert main(["run", *words, *positions]) == 0
    assert "1 positions took no part: object 77 and the like" in capsys.readouterr().err
