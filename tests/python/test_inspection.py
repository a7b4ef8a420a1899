"""Each mistake is planted in files that are right, where its check is silent."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import realdata
from dqslam import Camera, _core
from dqslam.inspection import inspect_recording
from dqslam.inspection.rays import inverted
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
    assert [finding.check for finding in inspection.findings] == ["poses"]
    assert "camera_from_world" in inspection.findings[0].message
    assert inspection.unchecked["distortion"] == "poses comes first"


def test_width_and_height_for_corners_are_found(right):
    camera, trajectory, table, ids = right
    box = np.hstack([table.box[:, :2], table.box[:, 2:] - table.box[:, :2]])
    (finding,) = inspect(camera, trajectory, replace(table, box=box), ids).findings
    assert finding.check == "box corners"
    assert finding.message.startswith("x1 y1 x2 y2 look like x, y, width, height")


def test_corners_for_width_and_height_are_found(right):
    camera, trajectory, table, ids = right
    box = np.hstack([table.box[:, :2], table.box[:, 2:] + table.box[:, :2]])
    stated = replace(table, box=box, columns=("left", "top", "width", "height"))
    (finding,) = inspect(camera, trajectory, stated, ids).findings
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
    inspection = inspect(camera, Trajectory(times, inverted(drifted)), table, ids)
    checks = [finding.check for finding in inspection.findings]
    # A few boxes of one object do not tell; and much noise may leave no reading that explains.
    assert checks in (["poses"], ["unexplained"]) or inspection.verdict.explained == "unsure"


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
    assert inspection.unchecked["poses"] == "times comes first"


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
    assert "scattered.csv:2: score is 100, not between 0 and 1 (" in finding.message


def test_what_cannot_be_told_is_said(tmp_path):
    camera, trajectory, table = scattered(tmp_path)
    first = {number: row for row, number in reversed(list(enumerate(table.track_id.tolist())))}
    same = replace(table, box=table.box[[first[number] for number in table.track_id.tolist()]])
    still = Trajectory(trajectory.timestamps, np.tile([0, 0, 0, 0, 0, 0, 1.0], (60, 1)))
    inspection = inspect(camera, still, same, "track_id")
    assert inspection.findings == ()
    assert inspection.verdict is None
    assert inspection.unchecked["poses"] == (
        "no object moves through the image and is seen often enough"
    )
    assert inspection.unchecked["distortion"] == (
        "no object is seen from directions that differ enough"
    )
    (finding,) = inspect(camera, still, table, "track_id").findings
    assert str(finding) == "poses: all poses are the same, but the boxes move through the image"
    few = replace(table, class_id=np.arange(len(table)))
    assert inspect(camera, trajectory, few, None).unchecked["poses"] == (
        "no object is seen often enough from known poses"
    )
    with pytest.raises(ValueError, match="one pose only"):
        inspect(camera, Trajectory(still.timestamps[:1], still.world_from_camera[:1]), table, None)
