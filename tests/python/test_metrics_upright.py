import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import scenes
from dqslam.metrics import up_direction


def test_a_street_has_its_up_against_the_image_rows():
    np.testing.assert_array_equal(up_direction(scenes.street_poses()), [0.0, -1.0, 0.0])


def test_an_orbit_looks_down_on_its_table():
    np.testing.assert_array_equal(up_direction(scenes.orbit_poses()), [0.0, 0.0, 1.0])


def test_a_part_of_an_orbit_that_is_tilted_all_along():
    np.testing.assert_array_equal(up_direction(scenes.orbit_poses(turns=0.4)), [0.0, 0.0, 1.0])


@pytest.mark.parametrize("vector", [[0.5, 0.2, -0.1], [2.0, -1.0, 0.3]])
def test_another_world_has_another_up(vector):
    turn = Rotation.from_rotvec(vector)
    poses = scenes.orbit_poses()
    poses[:, :3] = turn.apply(poses[:, :3])
    poses[:, 3:] = (turn * Rotation.from_quat(poses[:, 3:])).as_quat()
    np.testing.assert_allclose(up_direction(poses), turn.apply([0.0, 0.0, 1.0]), atol=1e-6)
