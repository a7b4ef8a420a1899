"""Steps that make no sense: refused at once, by one sentence, and nothing has changed.

Steps at the limits are taken, and nothing after them fails. All of it in every configuration.
"""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dqslam as dq
from dqslam import Motion, OnlineSlam, StepError

CONFIGURATIONS = {
    "believed": {},
    "doubted": {"trust_ids": 0.9, "estimates_noise": True},
    "movers": {"finds_movers": True},
    "without ids": {},
}
BEFORE, AFTER = 14, 6  # steps around the wrong one


class Drive:
    """Some steps of a simulated drive past objects, and a map of it."""

    def __init__(self, model, folder):
        scenario = {"SE2": "paper", "SE3": "orbit"}[model]
        recording, _ = dq.simulate(dq.load_scenario(scenario), seed=1)
        self.camera, self.first_pose = recording.camera, recording.odometry.first_pose
        steps = list(dq.steps_of(recording))
        with_boxes = next(i for i in range(40, 200) if len(steps[i].boxes.box) > 1)
        self.steps = steps[with_boxes - BEFORE : with_boxes + AFTER + 1]
        self.map = folder / model
        slam = OnlineSlam(self.camera, first_pose=self.first_pose)
        for number, step in enumerate(steps[: with_boxes + 40]):
            slam.add(step.odometry if number else None, step.boxes, timestamp=step.timestamp)
        slam.save(self.map)

    def session(self, configuration, *, is_loaded):
        options = {"first_pose": self.first_pose, **CONFIGURATIONS[configuration]}
        if not is_loaded:
            return OnlineSlam(self.camera, **options)
        mount = self.camera.robot_from_camera
        return OnlineSlam.load(self.map, robot_from_camera=mount, **options)


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    folder = tmp_path_factory.mktemp("maps")
    return {model: Drive(model, folder) for model in ("SE2", "SE3")}


def changed(boxes, row, **entries):
    """Return boxes with some entries of one row changed."""
    changes = {}
    for name, value in entries.items():
        array = np.array(getattr(boxes, name))
        array = array.astype(np.result_type(array, np.asarray(value)))
        array[row] = value
        changes[name] = array
    return replace(boxes, **changes)


def wrong_steps(step):
    """Yield odometry, boxes and time of steps to be refused, with words of the sentence."""
    odometry, boxes, time = step.odometry, step.boxes, step.timestamp
    relative = np.asarray(odometry.relative)
    size, k = len(relative), len(np.asarray(odometry.covariance))

    def moved(place, value):
        there = relative.astype(np.result_type(relative, np.asarray(value)))
        there[place] = value
        return Motion(there, odometry.covariance)

    def sure(covariance):
        return Motion(relative, covariance)

    eye, tilted = np.eye(k), np.eye(k)
    tilted[0, 1] = 1e-3
    for box, words in (
        ([1e4, 1e4, 1.1e4, 1.1e4], "outside the image"),
        ([-90.0, 20.0, -1.0, 70.0], "outside the image"),
        ([0.0, 0.0, 1e100, 1e100], "beyond 1e"),
        ([-1e7, 0.0, 50.0, 50.0], "beyond 1e"),
        ([50.0, 50.0, 50.0, 60.0], "inverted or empty"),
        ([np.inf, 0.0, 5.0, 5.0], "NaN or infinite"),
        ([0.0, np.nan, 5.0, 5.0], "NaN or infinite"),
    ):
        yield odometry, changed(boxes, 1, box=box), time, f"boxes row 1: {words}"
    yield odometry, changed(boxes, 0, box=1j), time, "boxes row 0: complex"
    yield odometry, changed(boxes, 1, object_id=-2), time, "object_id row 1: not an object id"
    ids = np.arange(len(boxes.box), dtype=np.uint64)
    ids[1] = 2**63
    yield odometry, replace(boxes, object_id=ids), time, "object_id row 1: not an object id"
    names = [*boxes.class_name[:-1], None]
    yield odometry, replace(boxes, class_name=names), time, "class_name row"
    flags = np.full((len(boxes.box), 4), 7)
    yield odometry, replace(boxes, truncated=flags), time, "truncated row 0: not true or false"
    for motion, words in (
        (moved(0, 1e9), "from the origin, beyond 5e"),
        (moved(1, -1e200), "from the origin"),
        (moved(0, np.nan), f"expected {size} finite numbers"),
        (moved(0, 1j), "complex"),
        (moved(2, 1e308), "odometry: "),
        (Motion(relative[:-1], eye), f"expected {size} finite numbers"),
        (sure(1e160 * eye), "variances not between"),
        (sure(1e-160 * eye), "variances not between"),
        (sure(-eye), "not symmetric positive definite"),
        (sure(tilted), "not symmetric positive definite"),
        (sure(np.ones((k, k))), "not symmetric positive definite"),
        (sure(np.full((k, k), np.nan)), "finite"),
        (sure(1j * eye), "complex"),
        (sure(eye[:2]), "expected shape"),
    ):
        yield motion, boxes, time, words
    for when, words in (
        (1.7e12, "beyond 1e+11 s"),
        (-1e300, "beyond"),
        (np.nan, "not finite"),
        (10**400, "step"),
        (-5.0, "is before"),
    ):
        yield odometry, boxes, when, words


def bits(slam):
    """Return all that a session tells, to the bit."""
    estimate = slam.estimate()
    parts = [estimate.poses, estimate.initial_poses, estimate.timestamps, estimate.object_ids]
    parts += [estimate.ellipsoids, estimate.observations, slam.objects.ellipsoids]
    parts += [slam.shown, slam.keyframes, *slam.assignments]
    told = (estimate.class_names, repr(slam), repr(slam.odometry_noise), repr(slam.size_prior))
    return [part.tobytes() for part in parts], told, slam.dropped


def files(folder: Path):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def without_ids(step):
    count = len(step.boxes.box)
    return replace(step, boxes=replace(step.boxes, object_id=np.full(count, -1)))


@pytest.fixture(autouse=True)
def no_warning_of_numpy():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def feed(slam, steps):
    for step in steps:
        odometry = step.odometry if len(slam) else None
        slam.add(odometry, step.boxes, timestamp=step.timestamp)


def all_of_it_works(slam, drive, folder):
    """Polish, save, load and relocalize; the last may say that it finds no pose."""
    assert slam.polish().result() is not None
    assert np.isfinite(slam.poses).all()
    slam.save(folder)
    assert len(dq.load_results(folder).poses) == len(slam)
    if len(slam.objects):
        loaded = OnlineSlam.load(folder)
        assert len(loaded.objects) == len(slam.objects)
    try:
        slam.relocalize(drive.steps[BEFORE].boxes)
    except ValueError as error:
        assert str(error).startswith("relocalize: ")


def _cases():
    for model in ("SE2", "SE3"):
        for configuration in CONFIGURATIONS:
            for is_loaded in (False, True):
                yield pytest.param(
                    model,
                    configuration,
                    is_loaded,
                    id=f"{model}-{configuration}-{'loaded' if is_loaded else 'fresh'}",
                )


CASES = list(_cases())


@pytest.mark.parametrize("polishes", [False, True])
@pytest.mark.parametrize(("model", "configuration", "is_loaded"), CASES)
def test_nothing_changes(drives, tmp_path, model, configuration, is_loaded, polishes):
    drive = drives[model]
    steps = drive.steps
    if configuration == "without ids":
        steps = [without_ids(step) for step in steps]
    slam = drive.session(configuration, is_loaded=is_loaded)
    feed(slam, steps[:BEFORE])
    if polishes:  # done, but merged by the next step only
        slam.polish(background=True).result()
    before = bits(slam)
    slam.save(tmp_path / "before")
    count = 0
    for odometry, boxes, time, words in wrong_steps(steps[BEFORE]):
        with pytest.raises(StepError) as error:
            slam.add(odometry, boxes, timestamp=time)
        assert words in str(error.value)
        assert str(error.value).startswith(f"step {BEFORE}: ")
        assert bits(slam) == before, words
        count += 1
    assert count > 25
    slam.save(tmp_path / "after")
    assert files(tmp_path / "after") == files(tmp_path / "before")
    feed(slam, steps[BEFORE:])
    all_of_it_works(slam, drive, tmp_path / "map")


def steps_at_the_limits(step):
    """Yield odometry and boxes of steps that are taken, however odd."""
    odometry, boxes = step.odometry, step.boxes
    relative, k = np.asarray(odometry.relative), len(np.asarray(odometry.covariance))
    wide = np.where(np.arange(k) < {3: 2, 6: 3}[k], 1e16, 1e6)
    yield Motion(relative, np.diag(wide)), boxes
    yield Motion(relative, 1e-24 * np.eye(k)), boxes
    yield odometry, changed(boxes, 1, box=[-1e6, -1e6, 1e6, 1e6])
    yield odometry, changed(boxes, 1, box=[100.0, 100.0, 100.0 + 1e-9, 100.0 + 1e-9])
    yield odometry, changed(boxes, 1, object_id=2**62)
    yield odometry, replace(boxes, object_id=np.full(len(boxes.box), 3))
    yield odometry, replace(boxes, truncated=np.ones((len(boxes.box), 4), dtype=bool))
    yield odometry, replace(boxes, box=np.zeros((0, 4)), object_id=[], class_name=())
    far = relative.copy()
    far[0] = 4e7
    yield Motion(far, odometry.covariance), boxes


@pytest.mark.parametrize(("model", "configuration", "is_loaded"), CASES)
def test_what_is_taken_is_taken_by_all(drives, tmp_path, model, configuration, is_loaded):
    drive = drives[model]
    steps = drive.steps
    if configuration == "without ids":
        steps = [without_ids(step) for step in steps]
    slam = drive.session(configuration, is_loaded=is_loaded)
    feed(slam, steps[:BEFORE])
    for odometry, boxes in steps_at_the_limits(steps[BEFORE]):
        slam.add(odometry, boxes)
        step = steps[BEFORE + 1]
        slam.add(step.odometry, step.boxes)
        assert np.isfinite(slam.poses).all()
    slam.add(step.odometry, step.boxes, timestamp=1e10)
    all_of_it_works(slam, drive, tmp_path / "map")


def test_a_session_without_steps_is_saved_and_loaded(drives, tmp_path):
    drive = drives["SE3"]
    empty = OnlineSlam(drive.camera)
    empty.save(tmp_path / "empty")
    again = OnlineSlam.load(tmp_path / "empty")
    assert (len(again), len(again.objects)) == (0, 0)
    with pytest.raises(dq.io.FileError, match=r"trajectory\.txt: holds no pose"):
        dq.load_results(tmp_path / "empty")
    mapped = OnlineSlam.load(drive.map)
    mapped.save(tmp_path / "mapped")
    known = OnlineSlam.load(tmp_path / "mapped")
    assert known.objects.object_ids.tolist() == mapped.objects.object_ids.tolist()
    np.testing.assert_allclose(known.objects.ellipsoids, mapped.objects.ellipsoids, atol=1e-8)


def test_the_first_motion_does_not_settle_the_model_if_it_is_refused(drives):
    slam = OnlineSlam(drives["SE3"].camera)
    slam.add(None)
    space = Motion([0.0, 0.0, 1e9, 0.0, 0.0, 0.0, 1.0], np.eye(6))
    with pytest.raises(StepError, match="step 1: odometry: leads"):
        slam.add(space)
    assert slam.pose_model == dq.PoseModel.SE2
    slam.add(Motion([0.1, 0.0, 0.0], np.eye(3)))
    assert slam.poses.shape == (2, 3)
