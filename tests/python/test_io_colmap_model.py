"""Results as COLMAP's text model, read by hand: points project to their observations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam import io
from dqslam.cli import main


def rows(path):
    return [line for line in path.read_text().splitlines() if not line.startswith("#")]


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = tmp_path_factory.mktemp("colmap")
    recording, _ = dq.simulate(dq.load_scenario("orbit"), seed=1)
    io.save_recording(recording, folder / "rec")
    files = [folder / "rec" / name for name in ("camera.json", "odometry.txt", "boxes.csv")]
    dq.run_files(*files, out=folder / "mine")
    assert main(["convert", str(folder / "mine"), str(folder / "m"), "--to", "colmap-model"]) == 0
    return folder


def test_the_model_is_that_of_the_results(model):
    results = dq.load_results(model / "mine")
    assert sorted(path.name for path in (model / "m").iterdir()) == [
        *("cameras.txt", "images.txt", "points3D.txt")
    ]
    camera = io.read_camera(model / "m/cameras.txt")
    assert (camera.fx, camera.cx, camera.width) == (525.0, 319.5, 640)
    images = rows(model / "m/images.txt")
    assert len(images) == 2 * len(results.poses)
    points = {int(row.split()[0]): row.split()[1:] for row in rows(model / "m/points3D.txt")}
    assert sorted(points) == results.objects.object_ids.tolist()
    centers = {one: np.array(cells[:3], dtype=float) for one, cells in points.items()}
    errors = {one: [] for one in points}
    tracks = {one: [] for one in points}
    for number, pose in enumerate(results.poses):
        head, seen = images[2 * number].split(), images[2 * number + 1].split()
        assert (head[0], head[8], head[9]) == (str(number + 1), "1", f"{number:06d}.png")
        w, x, y, z, *translation = map(float, head[1:8])
        turn = Rotation.from_quat([x, y, z, w])
        # camera_from_world takes the camera's position to the origin.
        np.testing.assert_allclose(turn.apply(pose[:3]) + translation, 0, atol=1e-7)
        for place in range(len(seen) // 3):
            pixel, one = (
                np.array(seen[3 * place : 3 * place + 2], dtype=float),
                int(seen[3 * place + 2]),
            )
            local = turn.apply(centers[one]) + translation
            # COLMAP's pixels begin at the corner.
            expected = local[:2] / local[2] * 525.0 + [320.0, 240.0]
            errors[one].append(np.linalg.norm(expected - pixel))
            tracks[one] += [number + 1, place]
    for one, cells in points.items():
        assert list(map(int, cells[7:])) == tracks[one]
        assert float(cells[6]) == pytest.approx(np.mean(errors[one]), rel=1e-6)
        assert np.mean(errors[one]) < 4.0
    boxes = results.boxes
    fit = boxes.inlier & np.isin(boxes.object_id, results.objects.object_ids)
    assert sum(map(len, errors.values())) == fit.sum()


def test_a_folder_with_files_is_kept(model, capsys):
    assert main(["convert", str(model / "mine"), str(model / "m"), "--to", "colmap-model"]) == 2
    assert "is there already, and not empty" in capsys.readouterr().err
