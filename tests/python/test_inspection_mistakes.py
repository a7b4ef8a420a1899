"""Each kind of mistake is named with what mends it, and right recordings have no warning."""

import functools
from dataclasses import replace

import pytest
from benchmarks.mistakes import MISTAKES, files_of, noisier, warnings_of

import dqslam as dq
import realdata
from dqslam import _core
from dqslam.inspection import image_checks, inspect_recording
from dqslam.io import read_camera, read_detections, read_trajectory
from dqslam.io.readings import BoxReading

WORLD, SEED = "orbit_rolls", 31
# The odometry of that world is too noisy for these; a drive on the plane tells them.
SUBTLE = {"one image late": "paper", "four images of drift": "paper"}


@functools.cache
def simulated(world, seed):
    recording, _ = dq.simulate(dq.load_scenario(world), seed=seed)
    return recording


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_with_what_mends_it(mistake):
    make, words = MISTAKES[mistake]
    files = make(files_of(simulated(SUBTLE.get(mistake, WORLD), SEED)))
    warnings = " ".join(warnings_of(files, "track_id"))
    assert [word for word in words if word not in warnings] == [], warnings


@pytest.mark.parametrize("seed", [31, 32])
@pytest.mark.parametrize("factor", [1, 4])
@pytest.mark.parametrize("ids", ["track_id", None])
@pytest.mark.parametrize(
    "world", ["orbit", "paper", "corridor_forward", "corridor_sideways", "false_10", "needles"]
)
def test_a_right_recording_has_no_warning(world, ids, factor, seed):
    """With noise four times as large as in the scenario, too; false boxes and thin objects."""
    recording = simulated(world, seed)
    files = files_of(recording)
    if factor > 1:
        files = noisier(files, factor, recording, seed)
    assert warnings_of(files, ids) == []


@pytest.mark.parametrize("scene", ["0049", "0051", "0053", "0055", "0057", "0059"])
@pytest.mark.parametrize("path", ["odometry_orbslam3_rgbd.txt", "groundtruth.txt"])
@pytest.mark.parametrize("ids", ["track_id", None])
def test_a_real_table_has_no_warning_of_a_reading(scene, path, ids):
    """Boxes of low scores leave the image, which is said; no other reading is named."""
    folder = realdata.recording("ycbv_orbslam3") / scene
    table = read_detections(folder / "detections_yolox.csv", cut=False, check=False)
    good = table.score >= 0.5
    columns = ("line", "frame", "timestamp", "box", "score", "class_id", "track_id")
    names = tuple(name for name, kept in zip(table.class_name, good, strict=True) if kept)
    table = replace(
        table, class_name=names, **{column: getattr(table, column)[good] for column in columns}
    )
    camera = read_camera(folder / "camera.json")
    inspection = inspect_recording(camera, read_trajectory(folder / path), table, ids=ids)
    assert [str(finding) for finding in inspection.findings if finding.check != "boxes"] == []
    assert inspection.verdict.explained == "yes"
    assert inspection.verdict.unexplained < 0.15


def test_the_offset_of_the_clocks_is_estimated():
    """Boxes two seconds, images of this drive, late: -2 s, within four sigmas."""
    make, _ = MISTAKES["two images late"]
    files = make(files_of(simulated("paper", SEED)))
    inspection = inspect_recording(files.camera, files.trajectory, files.table, ids="track_id")
    clock = inspection.clock
    assert clock.sure
    assert clock.seconds == pytest.approx(-2.0, abs=max(4 * clock.sigma, 0.2))
    assert clock.sigma < 0.3


def test_noise_that_hides_everything_is_said_not_reassured():
    recording = simulated("orbit", SEED)
    files = noisier(files_of(recording), 5, recording, 1)
    inspection = inspect_recording(files.camera, files.trajectory, files.table, ids="track_id")
    assert inspection.findings == ()
    assert inspection.verdict.explained == "noisy"
    assert "readings cannot be told apart" in inspection.unchecked["unexplained"]


def test_images_that_detectors_make_of_wide_ones_are_tried():
    """Of 1280 x 720 px: 640 x 360, and that with bars of 12 px to 384, a multiple of 32."""
    camera = _core.Camera(900, 900, 639.5, 359.5, 1280, 720)
    tried = list(image_checks._images(camera))
    assert BoxReading(image=(640, 360)) in tried
    with_bars = BoxReading(image=(640, 384), letterbox=True)
    assert with_bars in tried
    assert len(set(tried)) == len(tried)
    assert BoxReading(image=(1280, 720)) not in tried
