"""``dqslam shape`` on files: meshes that come back, numbers, and one error for each mistake."""

import json
import shutil

import numpy as np
import pytest
from PIL import Image

import dqslam as dq
from console import assert_one_line_of_error
from depth_scenes import CAMERA, Cuboid, Floor, at, cast, results_of, ring, write_files
from dqslam.cli import main
from realdata import recording

BODIES = [
    at(0.0, 0.0, 0.2, half=(0.25, 0.2, 0.2), yaw=0.3, kind=Cuboid),
    at(0.6, 0.1, 0.15, half=(0.15, 0.15, 0.15), yaw=0.8),
]
PATH = ring(12, 1.7, 0.9, target=(0.2, 0.0, 0.2))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Write results with depth and color images, and the boxes of the first object."""
    folder = tmp_path_factory.mktemp("made")
    results = results_of(PATH, BODIES)
    write_files(folder / "results", results, cast(PATH, [*BODIES, Floor()], sigma=0.002))
    rows = ["timestamp,x1,y1,x2,y2,truncated,score,class_id,class_name,object_id,inlier,held_out"]
    rows += [f"{time!r},10,10,300,200,,1,0,thing,0,1,0" for time in results.timestamps.tolist()]
    (folder / "results" / "boxes.csv").write_text("\n".join(rows) + "\n")
    (folder / "color").mkdir()
    for time in results.timestamps:
        image = np.full((CAMERA.height, CAMERA.width, 3), (200, 100, 50), dtype=np.uint8)
        Image.fromarray(image).save(folder / "color" / f"{time:.6f}.png")
    return folder


@pytest.fixture
def files(made, tmp_path):
    return shutil.copytree(made, tmp_path / "files")


def arguments(files, *more, scale=5000):
    given = [str(files / "results"), "--depth", str(files / "depth")]
    return ["shape", *given, "--depth-scale", str(scale), "--voxel", "0.015", *map(str, more)]


def test_meshes_numbers_and_positions_are_written(files, capsys):
    import trimesh

    more = ("--images", files / "color", "--positions", files / "positions.csv", "--json")
    assert main(arguments(files, *more)) == 0
    printed = json.loads(capsys.readouterr().out)
    folder = files / "results" / "surfaces"
    names = {path.name for path in folder.iterdir()}
    meshes = {f"object_{k}.{suffix}" for k in (0, 1) for suffix in ("ply", "glb")}
    assert names == meshes | {"surfaces.json", "config.toml", "manifest.json"}
    assert len((files / "positions.csv").read_text().splitlines()) == 1 + 12
    table = json.loads((folder / "surfaces.json").read_text())
    assert [one["id"] for one in table["objects"]] == [0, 1]
    assert table["objects"] == printed["objects"]
    assert (table["images"], table["images_left_out"], printed["positions"]) == (12, 0, 12)
    read = dq.surface.read_meshes(folder)
    for body, one in zip(BODIES, table["objects"], strict=True):
        assert one["volume_m3"] == pytest.approx(body.volume, rel=0.06)
        sides = 2 * np.sort(body.half)[::-1]
        np.testing.assert_allclose(one["extents_m"], sides, atol=2.5 * 0.015)
        mesh = read[one["id"]]
        assert (len(mesh.vertices), len(mesh.faces)) == (one["vertices"], one["faces"])
        in_world = mesh.vertices @ body.turn.T + body.center
        assert np.median(np.abs(body.distance(in_world))) < 0.3 * 0.015
        again = trimesh.load(folder / f"object_{one['id']}.glb", force="mesh", process=False)
        np.testing.assert_allclose(again.vertices, mesh.vertices, atol=1e-5)
        np.testing.assert_array_equal(again.faces, mesh.faces)
        assert np.median(mesh.colors, axis=0).tolist() == [200, 100, 50]


def test_a_table_says_what_was_measured(files, capsys):
    assert main(arguments(files, "--out", files / "out")) == 0
    said = capsys.readouterr()
    assert "thing" in said.out
    assert f"wrote {files / 'out'}" in said.out
    assert main(arguments(files, "--out", files / "out", "-q")) == 0  # replaces its own
    assert capsys.readouterr().out == ""


def break_size(files):
    path = sorted((files / "depth").iterdir())[3]
    Image.fromarray(np.zeros((120, 160), dtype=np.uint16)).save(path)
    return path


def break_end(files):
    path = sorted((files / "depth").iterdir())[3]
    path.write_bytes(path.read_bytes()[:500])
    return path


def break_kind(files):
    path = sorted((files / "depth").iterdir())[3]
    Image.fromarray(np.zeros((240, 320, 3), dtype=np.uint8)).save(path)
    return path


def break_content(files):
    path = sorted((files / "depth").iterdir())[3]
    path.write_text("no image")
    return path


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (break_size, "is 160 x 120, but the camera's are 320 x 240: depth must be registered"),
        (break_end, "its end is missing or wrong"),
        (break_kind, "is no depth image: its pixels are RGB, not grey of 16 bits"),
        (break_content, "cannot be read as an image"),
    ],
)
def test_a_wrong_image_is_named(files, capsys, spoil, message):
    path = spoil(files)
    assert main(arguments(files)) == 2
    shown = capsys.readouterr()
    assert f"dqslam: {path}: " in shown.err
    assert message in shown.err
    assert shown.err.count("\n") == 1
    assert not (files / "results" / "surfaces").exists()


def test_a_wrong_scale_names_the_likely_one(files, capsys):
    assert main(arguments(files, scale=1000)) == 2
    assert_one_line_of_error(capsys, "--depth-scale 1000 seems wrong, 5000 would fit")


def test_what_is_missing_is_named(files, capsys):
    assert main(["shape", str(files / "no"), "--depth", "x", "--depth-scale", "1"]) == 2
    assert_one_line_of_error(capsys, "no: no such directory")
    shutil.rmtree(files / "depth")
    assert main(arguments(files)) == 2
    assert_one_line_of_error(capsys, "depth: no such folder of images")
    (files / "depth").mkdir()
    assert main(arguments(files)) == 2
    assert_one_line_of_error(capsys, "depth: holds no images")
    assert main(arguments(files, scale=0)) == 2
    assert_one_line_of_error(capsys, "depth scale is 0, not a positive number")


def test_images_of_other_times_are_refused(files, capsys):
    for path in sorted((files / "depth").iterdir())[2:]:
        path.unlink()
    for number, path in enumerate(sorted((files / "depth").iterdir())):
        path.rename(path.with_name(f"frame{number}.png"))
    assert main(arguments(files)) == 2
    assert_one_line_of_error(capsys, "2 images (the first is frame0.png), 12 poses")


def test_meshes_that_are_wrong_are_named(files):
    assert main(arguments(files, "-q")) == 0
    folder = files / "results" / "surfaces"
    (folder / "object_0.ply").write_text("ply\nno")
    with pytest.raises(ValueError, match=r"object_0.ply: cannot be read as a mesh"):
        dq.surface.read_meshes(folder)
    (folder / "object_0.ply").unlink()
    with pytest.raises(ValueError, match=r"object_0.ply: no such file"):
        dq.surface.read_meshes(folder)
    (folder / "surfaces.json").write_text("{}")
    with pytest.raises(ValueError, match="has no list of objects"):
        dq.surface.read_meshes(folder)


def test_ctrl_c_leaves_nothing(files, monkeypatch, capsys):
    from dqslam.surface.volume import Volume

    def stop(self, view):
        raise KeyboardInterrupt

    monkeypatch.setattr(Volume, "integrate", stop)
    assert main(arguments(files)) == 130
    assert_one_line_of_error(capsys, "stopped")
    assert {path.name for path in (files / "results").iterdir()} == {
        *("trajectory.txt", "odometry.txt", "camera.json", "map.json", "boxes.csv")
    }


def test_a_real_cabinet(tmp_path, capsys):
    """The path is of motion capture; the reference is a cuboid of planes, good to 1 to 2 cm."""
    from scipy.spatial.transform import Rotation

    folder, images = recording("tum_fr3_cabinet"), recording("tum_fr3_cabinet_images")
    names = {"camera": "camera.json", "odometry": "groundtruth.txt"}
    names["detections"] = "detections_yolo.csv"
    given = [word for key, name in names.items() for word in (f"--{key}", str(folder / name))]
    out = tmp_path / "out"
    assert main(["run", *given, "--ids", "track_id", "--out", str(out), "-q"]) == 0
    command = ["shape", str(out), "--depth", str(images / "depth"), "--depth-scale", "5000"]
    assert main([*command, "--voxel", "0.015", "--json"]) == 0
    (one,) = json.loads(capsys.readouterr().out)["objects"]
    cells = (images / "object_ref_depth.csv").read_text().splitlines()[-1].split(",")[2:]
    numbers = np.array(cells, dtype=float)
    turn, sides = Rotation.from_quat(numbers[3:7]).as_matrix(), numbers[7:]
    mesh = dq.surface.read_meshes(out / "surfaces")[0]
    in_world = (
        Rotation.from_quat(one["orientation_xyzw"]).apply(np.array(mesh.vertices)) + one["center"]
    )
    reference = Cuboid(numbers[:3], turn, sides / 2)
    assert np.median(np.abs(reference.distance(in_world))) < 0.006
    assert one["volume_m3"] == pytest.approx(sides.prod(), rel=0.06)
    np.testing.assert_allclose(one["extents_m"], np.sort(sides)[::-1], atol=0.04)
    assert one["seen_share"] > 0.9
