"""Sizes of well-known classes, which tell the unit of the positions."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam import io
from dqslam.inspection import inspect_recording
from dqslam.inspection.usual_sizes import size_factor

NAMES = ("cup", "bowl", "vase", "teddy bear")


def test_a_factor_common_to_three_classes_is_told():
    feet = {"cup": 0.09 / 0.3048, "book": 0.17 / 0.3048, "keyboard": 0.22 / 0.3048}
    assert size_factor(feet) == pytest.approx(1 / 0.3048)
    assert size_factor({name: size * 30.0 for name, size in feet.items()}) == pytest.approx(
        98.4, 1e-2
    )


def test_usual_sizes_few_classes_and_toys_tell_nothing():
    assert size_factor({"cup": 0.12, "book": 0.15, "keyboard": 0.3}) is None
    assert size_factor({"cup": 9.0, "book": 17.0}) is None
    assert size_factor({"cup": 9.0, "book": 17.0, "thing": 22.0}) is None
    # A toy car and a toy bus between things as large as usual.
    assert size_factor({"car": 0.1, "bus": 0.15, "cup": 0.09, "book": 0.17}) is None


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Return camera, path and boxes of a table with objects of 0.07 to 0.25 m, named by size."""
    folder = tmp_path_factory.mktemp("orbit")
    recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=5)
    io.save_recording(recording, folder)
    boxes = io.read_detections(folder / "boxes.csv", cut=False, check=False)
    sizes = np.cbrt(6.0 * truth.volumes / np.pi)  # diameters of spheres
    order = np.argsort(np.argsort(sizes)) * len(NAMES) // len(sizes)
    number = order[np.searchsorted(truth.object_ids, boxes.track_id)]
    named = replace(boxes, class_id=number, class_name=tuple(NAMES[one] for one in number.tolist()))
    return recording.camera, io.read_trajectory(folder / "odometry.txt"), named


@pytest.mark.parametrize(
    ("meters", "option"), [(1.0, None), (0.3048, "feet (--length-scale 0.3048)"), (0.01, "0.01")]
)
def test_feet_and_centimeters_are_told(table, meters, option):
    camera, (times, poses), boxes = table
    scaled = io.Trajectory(times, poses / np.array([meters] * 3 + [1.0] * 4))
    found = inspect_recording(camera, scaled, boxes, ids="track_id").findings
    if option is None:
        assert found == ()
    else:
        [finding] = found
        assert finding.check == "units"
        assert option in finding.message
        assert "times as large as usual (bowl" in finding.message
