"""The paper's own world, where odometry is ten times worse in turns, with default options."""

from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam.association import associate, fill_in

PAPER = dq.load_scenario("paper")


def drive(seed, factor=1.0):
    """Return a recording of boxes and odometry alone, and the truth."""
    odometry = PAPER.odometry
    names = (
        "translation_sigma_m",
        "rotation_sigma_rad",
        "turn_rotation_sigma_rad",
        "lateral_sigma_m",
    )
    worse = odometry.model_copy(update={name: factor * getattr(odometry, name) for name in names})
    recording, truth = dq.simulate(PAPER.model_copy(update={"odometry": worse}), seed=seed)
    return replace(recording, positions=None), truth


def error(poses, truth):
    """Return the mean distance of positions, meters."""
    return np.linalg.norm(poses[:, :2] - truth.poses[:, :2], axis=1).mean()


@pytest.mark.parametrize("seed", [0, 2, 3, 100])
def test_estimated_noise_is_as_good_as_given_noise(seed):
    recording, truth = drive(seed)
    result = dq.run(recording, dq.RunOptions(estimates_noise=True))
    assert error(result.estimate.poses, truth) <= 0.25
    assert len(result.estimate.object_ids) >= 7
    noise = result.report["odometry_noise"]
    assert noise["levels"]["rotation_z"] == pytest.approx(0.02, rel=0.25)
    # 100 mrad on steps that turn, an eighth of all: 40 mrad in the root mean square, of 8 turns.
    assert 0.03 <= noise["rotation_rad"] <= 0.065
    assert result.report["box_noise"] == {"pixels": 2.0, "relative": 0.05}  # never less
    given = dq.run(recording)
    assert given.report["odometry_noise"] == {"from": "given"}
    assert error(given.estimate.poses, truth) <= 0.25


def test_ids_are_believed_from_the_start_where_the_gate_refuses_them():
    recording, truth = drive(2, factor=4.0)
    found = associate(recording, trust=1.0)
    assert error(fill_in(recording, found.keyframes, found.scene.poses), truth) <= 0.5
    assert "made again with all ids believed from the start" in found.remarks[0]
    assert found.remarks[0].endswith("and is used")


def test_boxes_without_a_map_are_warned_of():
    recording, _ = drive(0)
    boxes = recording.detections
    corner = np.random.default_rng(0).uniform(0, 800, (len(boxes), 2))
    anywhere = replace(boxes, box=np.hstack([corner, corner + 150.0]))
    result = dq.run(replace(recording, detections=anywhere), dq.RunOptions(estimates_noise=True))
    assert result.report["objects"] == []
    count = len(boxes)
    assert result.report["warnings"][-1] == (
        f"the map is empty, though there are {count} boxes: the odometry is uncorrected"
    )
