from dataclasses import replace

import numpy as np
import pytest

import dqslam as dq
from dqslam.association.first_levels import FIRST_SHARE, first_levels, look
from dqslam.association.noise import StepNoise
from dqslam.simulation import perturb_odometry


@pytest.fixture(scope="module")
def orbit():
    recording, _ = dq.simulate(dq.load_scenario("orbit"), seed=1)
    return recording


def seen(recording):
    steps = np.arange(len(recording.timestamps))
    return look(recording, recording.detections.object_id, steps)


def test_the_level_is_high_and_follows_the_noise(orbit):
    for sigma in (0.02, 0.04):
        noisy = perturb_odometry(orbit, dq.OdometryNoise(1e-6, sigma), seed=2)
        assert sigma <= seen(noisy).angle <= 5.0 * sigma


def test_sizes_and_distances_have_the_units_of_the_odometry(orbit):
    odometry = orbit.odometry
    relative, first = odometry.relative.copy(), odometry.first_pose.copy()
    relative[:, :3] *= 1e3
    first[:3] *= 1e3
    millimeters = replace(orbit, odometry=replace(odometry, relative=relative, first_pose=first))
    one, other = seen(orbit), seen(millimeters)
    assert other.angle == pytest.approx(one.angle)
    assert other.distance == pytest.approx(1e3 * one.distance)
    assert other.log_size == pytest.approx(one.log_size + np.log(1e3))


def test_without_rays_that_meet_the_default_is_taken(orbit):
    boxes = orbit.detections
    assert seen(replace(orbit, detections=boxes.select(slice(0, 5)))) is None
    corner = np.random.default_rng(0).uniform(0, 400, (len(boxes), 2))
    anywhere = replace(boxes, box=np.hstack([corner, corner + 50.0]))
    assert seen(replace(orbit, detections=anywhere)) is None
    noise = StepNoise.between(orbit, np.arange(len(orbit.timestamps)))
    default = dq.OdometryNoise()
    levels = dict(zip(noise.names, first_levels(noise, None).tolist(), strict=True))
    assert levels["translation_x"] == default.translation_m
    assert levels["rotation_z"] == default.rotation_rad
    assert levels["length"] < 0.1 * FIRST_SHARE
