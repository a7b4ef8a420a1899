"""Each mistake is planted in files that are right, where its check is silent."""

import functools
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import realdata
from dqslam import Camera, _core
from dqslam.cli import main
from dqslam.inspect_recording import inspect_recording
from dqslam.inspect_recording.rays import Views, inverted, residuals
from dqslam.inspect_recording.tracks import overlap, overlap_ids
from dqslam.io import Trajectory, read_camera, read_detections, read_trajectory
from orbit import make_orbit, write_orbit

# Folder, camera, trajectory, boxes, ids.
LMO, DESK, CABINET, KITTI = "bop_lmo", "tum_fr2_desk", "tum_fr3_cabinet", "kitti_tracking"
SEGMENT = "seg_0703_1001"
REAL = {
    "table top": (
        LMO,
        "camera.json",
        f"{SEGMENT}/groundtruth.txt",
        f"{SEGMENT}/detections_fasterrcnn.csv",
        "track_id",
    ),
    "table top without ids": (
        LMO,
        "camera.json",
        f"{SEGMENT}/groundtruth.txt",
        f"{SEGMENT}/detections_maskrcnn.csv",
        None,
    ),
    "street": (
        KITTI,
        "0005/camera.json",
        "0005/trajectory_reference.txt",
        "0005/boxes_gt.csv",
        "track_id",
    ),
    "street without ids": (
        KITTI,
        "0005/camera.json",
        "0005/trajectory_reference.txt",
        "0005/detections_rrc.csv",
        None,
    ),
    "street by a tracker": (
        KITTI,
        "0005/camera.json",
        "0005/trajectory_reference.txt",
        "0005/tracks_yolox_strongsort.csv",
        "track_id",
    ),
    "desk": (DESK, "camera.json", "odometry_orbslam2_rgbd.txt", "detections_yolov5.csv", None),
    "desk by motion capture": (
        DESK,
        "camera.json",
        "groundtruth_frames.txt",
        "detections_yolov5.csv",
        None,
    ),
    "cabinet": (CABINET, "camera.json", "groundtruth.txt", "detections_yolo.csv", "track_id"),
}


@functools.cache
def real(kind):
    name, *files, ids = REAL[kind]
    return read(*(realdata.recording(name) / file for file in files), ids)


def read(camera, path, boxes, ids):
    table = read_detections(boxes, cut=False, check=False)
    return read_camera(camera), read_trajectory(path), table, ids


@pytest.fixture(params=["orbit", *REAL])
def right(request, tmp_path):
    """Camera, trajectory, boxes, ids of a recording without a mistake."""
    if request.param != "orbit":
        return real(request.param)
    return read(*write_orbit(tmp_path, make_orbit(noise_px=1.0)), "track_id")


def found(camera, trajectory, table, ids):
    return [finding.check for finding in inspect(camera, trajectory, table, ids).findings]


def inspect(camera, trajectory, table, ids):
    return inspect_recording(camera, trajectory, table, ids=ids)


def resized(camera, width, height, **more):
    lens = {"distortion": camera.distortion} | more
    return Camera(camera.fx, camera.fy, camera.cx, camera.cy, width, height, **lens)


def test_all_is_well(right):
    assert found(*right) == []


def test_inverted_poses_are_found(right):
    camera, (times, poses), table, ids = right
    inspection = inspect(camera, Trajectory(times, inverted(poses)), table, ids)
    assert [finding.check for finding in inspection.findings] == ["pose direction"]
    assert "camera_from_world" in inspection.findings[0].message
    assert inspection.unchecked["distortion"] == "pose direction comes first"


def test_width_and_height_for_corners_are_found(right):
    camera, trajectory, table, ids = right
    box = np.hstack([table.box[:, :2], table.box[:, 2:] - table.box[:, :2]])
    (finding,) = inspect(camera, trajectory, replace(table, box=box), ids).findings
    assert finding.check == "box corners"
    assert finding.message.startswith("x1 y1 x2 y2 look like x, y, width, height")


def test_corners_for_width_and_height_are_found(right):
    camera, trajectory, table, ids = right
    box = np.hstack([table.box[:, :2], table.box[:, 2:] + table.box[:, :2]])
    (finding,) = inspect(camera, trajectory, replace(table, box=box), ids).findings
    assert finding.check == "box corners"
    assert finding.message.startswith("x, y, width, height look like x1 y1 x2 y2")


@pytest.mark.parametrize("planted", ["half", "double", "swapped"])
def test_another_image_size_is_found(right, planted):
    camera, *rest = right
    width, height = camera.width, camera.height
    size = {
        "half": (width // 2, height // 2),
        "double": (2 * width, 2 * height),
        "swapped": (height, width),
    }[planted]
    assert found(resized(camera, *size), *rest) == ["image size"]


@pytest.mark.parametrize("kind", ["table top without ids", "desk", "desk by motion capture"])
def test_a_larger_image_with_its_principal_point_is_found_by_the_border(kind):
    """Both scaled: only that boxes pile up where the true image ends can tell."""
    camera, *rest = real(kind)
    focal, middle = (2 * camera.fx, 2 * camera.fy), (camera.width, camera.height)
    scaled = Camera(*focal, *middle, 2 * camera.width, 2 * camera.height)
    assert found(scaled, *rest)[:1] == ["image size"]


def test_odometry_that_drifts_is_no_mistake(right):
    camera, (times, poses), table, ids = right
    random = np.random.default_rng(0)
    # 0.05 m and 0.01 rad a step, less where there are more than 500.
    share = min(1.0, 500 / len(times))
    steps = _core.between(_core.PoseModel.SE3, poses[:-1], poses[1:])
    noise = random.normal(0, share * np.repeat([0.05, 0.01], 3), (len(steps), 6))
    steps = _core.plus(_core.PoseModel.SE3, steps, noise)
    drifted = _core.dead_reckon(_core.PoseModel.SE3, poses[0], steps)
    assert found(camera, Trajectory(times, drifted), table, ids) == []
    assert found(camera, Trajectory(times, inverted(drifted)), table, ids) == ["pose direction"]


@pytest.mark.parametrize("name", ["milliseconds", "microseconds", "nanoseconds"])
def test_another_unit_of_time_is_found(right, name):
    camera, (times, poses), table, ids = right
    factor = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}[name]
    (finding,) = inspect(camera, Trajectory(times * factor, poses), table, ids).findings
    assert finding.message.startswith(f"times of the poses look like {name}")
    ticks = replace(table, timestamp=table.timestamp * factor)
    (finding,) = inspect(camera, Trajectory(times, poses), ticks, ids).findings
    assert finding.message.startswith(f"times of the boxes look like {name}")


def test_clocks_that_do_not_meet_are_found(right):
    camera, (times, poses), table, ids = right
    late = Trajectory(times + 2 * np.ptp(times), poses)
    inspection = inspect(camera, late, table, ids)
    assert [finding.check for finding in inspection.findings] == ["times"]
    assert inspection.findings[0].message.startswith("no box has a pose within")
    assert inspection.unchecked["pose direction"] == "times comes first"


def test_a_lens_whose_distortion_is_missing_is_found():
    camera, *rest = real("desk")
    bare = resized(camera, 640, 480, distortion=np.zeros(5))
    (finding,) = inspect(bare, *rest).findings
    assert finding.check == "distortion"
    assert "come from a distorted image" in finding.message


def test_boxes_that_are_undistorted_already_are_found():
    camera, trajectory, table, ids = real("desk")
    straight = replace(table, box=camera.undistort_boxes(table.box))
    (finding,) = inspect(camera, trajectory, straight, ids).findings
    assert finding.check == "distortion"
    assert "undistorted already" in finding.message
    bare = resized(camera, 640, 480, distortion=np.zeros(5))
    assert found(bare, trajectory, straight, ids) == []


def test_a_distorted_orbit_is_found(tmp_path):
    """The lens of a wide camera, on boxes of objects all over the image."""
    camera, trajectory, table = scattered(tmp_path)
    lens = resized(camera, 640, 480, distortion=np.array([-0.2, 0.1, 0, 0, 0]))
    bent = lens.distort_points(table.box.reshape(-1, 2)).reshape(-1, 4)
    assert found(camera, trajectory, table, "track_id") == []
    assert found(lens, trajectory, replace(table, box=bent), "track_id") == []
    assert found(camera, trajectory, replace(table, box=bent), "track_id") == ["distortion"]


def scattered(tmp_path):
    """Points in a cube of 3 m, as boxes of 20 px, seen from a path through all directions."""
    random = np.random.default_rng(3)
    points = random.uniform(-1.5, 1.5, (40, 3)) + [0, 0, 4]
    position = random.uniform(-0.5, 0.5, (60, 3))
    turns = Rotation.from_rotvec(random.normal(0, 0.1, (60, 3)))
    rows = []
    for i, (at, turn) in enumerate(zip(position, turns, strict=True)):
        local = turn.inv().apply(points - at)
        pixel = 400 * local[:, :2] / local[:, 2:] + [320, 240] + random.normal(0, 0.5, (40, 2))
        inside = np.all((pixel > 15) & (pixel < [625, 465]), axis=1)
        for number in np.flatnonzero(inside):
            x, y = pixel[number]
            box = f"{x - 10},{y - 10},{x + 10},{y + 10}"
            rows.append(f"{i},{0.1 * i!r},{box},1,0,point,{number}")
    path = tmp_path / "scattered.csv"
    header = "frame,timestamp,x1,y1,x2,y2,score,class_id,class_name,track_id"
    path.write_text("\n".join([header, *rows]) + "\n")
    trajectory = Trajectory(0.1 * np.arange(60), np.hstack([position, turns.as_quat()]))
    camera = Camera(400, 400, 320, 240, 640, 480)
    return camera, trajectory, read_detections(path)


def test_what_the_reader_refuses_is_found(tmp_path):
    camera, trajectory, table = scattered(tmp_path)
    percent = replace(table, score=100 * table.score)
    (finding,) = inspect(camera, trajectory, percent, "track_id").findings
    assert finding.check == "boxes"
    assert finding.message.endswith("scattered.csv:2: score is 100, not between 0 and 1")


def test_what_cannot_be_told_is_said(tmp_path):
    camera, trajectory, table = scattered(tmp_path)
    first = {number: row for row, number in reversed(list(enumerate(table.track_id.tolist())))}
    same = replace(table, box=table.box[[first[number] for number in table.track_id.tolist()]])
    still = Trajectory(trajectory.timestamps, np.tile([0, 0, 0, 0, 0, 0, 1.0], (60, 1)))
    inspection = inspect(camera, still, same, "track_id")
    assert inspection.findings == ()
    why = "no object is seen from directions that differ enough"
    assert inspection.unchecked == {"pose direction": why, "distortion": why}
    inspection = inspect(camera, still, table, "track_id")
    assert inspection.unchecked == {
        "pose direction": "no reading of the poses puts the objects in front of the camera",
        "distortion": "rays miss each other by more than the image, too much to tell a lens by",
    }
    few = replace(table, class_id=np.arange(len(table)))
    assert inspect(camera, trajectory, few, None).unchecked["pose direction"] == (
        "no object is seen often enough from known poses"
    )
    with pytest.raises(ValueError, match="one pose only"):
        inspect(camera, Trajectory(still.timestamps[:1], still.world_from_camera[:1]), table, None)


def test_rays_by_hand():
    """Two metres ahead and 0.2 m aside of cameras that move sideways; one middle 500 px off."""
    camera = Camera(400, 400, 320, 240, 640, 480)
    x = np.array([-0.4, -0.2, 0.0, 0.2, 0.4])
    poses = np.zeros((3, 5, 7))
    poses[..., 0], poses[..., 6] = x, 1
    middle = np.dstack([320 + 400 * (0.2 - x) / 2, np.full(5, 240.0)]).repeat(3, axis=0)
    there = np.ones((3, 5), dtype=bool)
    there[1, 4] = False  # a shorter track
    poses[2], middle[2] = poses[0, 0], middle[0, 0]  # one that stands still
    middle[0, 2, 1] += 500
    off = residuals(camera, Views(poses, middle, there))
    assert off[0, 2] == pytest.approx(500, abs=2)
    assert np.delete(off[0], 2).max() < 2
    np.testing.assert_allclose(off[1, :4], 0, atol=1e-9)
    assert np.isnan(off[1, 4])
    assert np.isnan(off[2]).all()
    behind = residuals(camera, Views(inverted(poses), middle, there))
    assert (behind[1, :4] == 1e4).all()


def test_inverted_twice_is_the_same():
    random = np.random.default_rng(0)
    poses = np.hstack([random.normal(0, 1, (9, 3)), Rotation.random(9, random).as_quat()])
    np.testing.assert_allclose(inverted(inverted(poses)), poses, atol=1e-14)
    turn = Rotation.from_quat(poses[:, 3:])
    np.testing.assert_allclose(turn.apply(inverted(poses)[:, :3]), -poses[:, :3], atol=1e-14)


def test_overlap_by_hand():
    boxes = np.array([[0.0, 0, 2, 2], [5, 5, 6, 6]])
    np.testing.assert_allclose(overlap(boxes, np.array([[1.0, 0, 3, 2]])), [[1 / 3], [0]])


def test_boxes_are_joined_by_overlap_within_their_class(tmp_path):
    rows = [
        "0,0,0,0,10,10,1,1,cup",
        "0,0,100,0,110,10,1,1,cup",
        "1,1,101,0,111,10,1,1,cup",
        "1,1,1,0,11,10,1,2,jar",
        "2,2,102,0,112,10,1,1,cup",
        "2,2,1,0,11,10,1,2,jar",
    ]
    path = tmp_path / "boxes.csv"
    header = "frame,timestamp,x1,y1,x2,y2,score,class_id,class_name"
    path.write_text("\n".join([header, *rows]))
    assert overlap_ids(read_detections(path), np.arange(6)).tolist() == [0, 1, 1, 2, 1, 2]


@pytest.fixture
def files(tmp_path):
    return write_orbit(tmp_path, make_orbit(noise_px=1.0))


def call(files, *more):
    names = ("--camera", "--odometry", "--detections")
    arguments = [str(word) for pair in zip(names, files, strict=True) for word in pair]
    return main(["inspect", *arguments, *more])


def test_the_summary(files, capsys):
    assert call(files, "--ids", "track_id", "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert (content["warnings"], content["unchecked"]) == ([], {"distortion": TOO_FEW})
    path, boxes = content["trajectory"], content["detections"]
    assert (path["poses"], path["start_s"], path["gaps"]) == (40, 100, [])
    assert path["rate_hz"] == pytest.approx(10)
    assert path["length_m"] == pytest.approx(7.46, abs=0.5)  # round a circle of 1.2 m
    assert (boxes["boxes"], boxes["frames"], boxes["boxes_a_frame"]) == (160, 40, [4.0] * 5)
    assert boxes["classes"] == {"box": 40, "lamp": 40, "book": 40, "cup": 40}
    assert (boxes["objects"], boxes["boxes_without_object"]) == (4, 0)
    assert boxes["at_border"] == {"left": 0, "top": 0, "right": 0, "bottom": 0, "any": 0}
    overlap = content["overlap"]
    assert (overlap["boxes_with_pose"], overlap["boxes_without_pose"]) == (160, 0)
    assert overlap["seconds"] == pytest.approx(3.9)


TOO_FEW = "only 4 objects to tell a lens by"


def test_gaps_borders_and_boxes_without_poses_are_counted(files, capsys):
    camera, path, boxes = files
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:10] + lines[20:]))
    text = boxes.read_text().splitlines(keepends=True)
    text.append("39,103.9,-0.5,10,30,479.2,0.9,1,cup,101\n")
    boxes.write_text("".join(text))
    assert call(files, "--ids", "track_id", "--json") == 0
    content = json.loads(capsys.readouterr().out)
    (gap,) = content["trajectory"]["gaps"]
    assert (gap["after_s"], gap["seconds"]) == (pytest.approx(100.9), pytest.approx(1.1))
    # The boxes at 101.0 to 101.9 s have no pose within half an interval.
    assert content["overlap"]["boxes_without_pose"] == 40
    assert content["detections"]["at_border"]["left"] == 1
    assert content["detections"]["at_border"]["bottom"] == 1
    assert content["detections"]["at_border"]["any"] == 1


def test_printed_and_strict(files, capsys):
    assert call(files, "--ids", "track_id", "--strict") == 0
    shown = capsys.readouterr().out
    assert "no mistake found" in shown
    assert f"not checked: distortion: {TOO_FEW}" in shown
    camera = json.loads(files[0].read_text())
    files[0].write_text(json.dumps(camera | {"width": 480, "height": 640}))
    assert call(files, "--ids", "track_id") == 0
    assert "warning: image size: the principal point" in capsys.readouterr().out
    assert call(files, "--ids", "track_id", "--strict") == 3


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--format", "bvh"), "format 'bvh' is none of"),
        (("--camera", "none.json"), "none.json: no such file"),
        (("--frame-rate", "0"), "frame rate is 0 Hz"),
    ],
)
def test_bad_arguments_are_one_line_and_code_2(files, capsys, more, message):
    assert call(files, *more) == 2
    shown = capsys.readouterr()
    assert message in shown.err
    assert shown.err.count("\n") == 1


def test_a_street_in_the_formats_of_kitti_and_mot(tmp_path, capsys):
    """No file has times: frames are counted."""
    folder = realdata.recording("kitti_tracking") / "0005"
    boxes = tmp_path / "boxes.txt"
    assert main(["convert", str(folder / "boxes_gt.csv"), str(boxes)]) == 0
    calib = tmp_path / "calib.txt"
    calib.write_text((folder / "calib.txt").read_text() + "S_rect_02: 1242 375\n")
    path = folder / "poses_orbslam3_stereo_kitti3x4.txt"
    capsys.readouterr()
    assert call((calib, path, boxes), "--ids", "track_id", "--json") == 0
    content = json.loads(capsys.readouterr().out)
    assert (content["warnings"], content["unchecked"]) == ([], {})
    assert content["overlap"]["boxes_with_pose"] == 1476


def test_quiet_says_nothing_but_the_exit_code(files, capsys):
    camera = json.loads(files[0].read_text())
    files[0].write_text(json.dumps(camera | {"width": 480, "height": 640}))
    assert call(files, "--ids", "track_id", "--strict", "--quiet") == 3
    assert capsys.readouterr() == ("", "")
