"""Numbers that make no sense are refused by array and row, and none wraps or loses a part."""

import warnings

import numpy as np
import pytest

import dqslam as dq
from dqslam._checks import as_covariances, as_floats, as_ints


@pytest.fixture(autouse=True)
def no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([[1.0, 2.0], [3.0, 4.0 + 1.0j]], r"^a row 0: complex, not real"),
        (np.ones(2, dtype=np.complex64), r"^a row 0: complex, not real"),
        (1j, r"^a row 0: complex, not real"),
        ([["x", "y"]], r"^a: not an array of numbers"),
        ([[1.0, 2.0], [np.nan, 0.0]], r"^a row 1: not finite"),
        ([[1.0], [1.0, 2.0]], r"^a: not an array of numbers"),
    ],
)
def test_floats(values, message):
    with pytest.raises(ValueError, match=message):
        as_floats("a", values, [None, 2])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.array([1, 2**63], dtype=np.uint64), r"^a row 1: too large for 64 bits"),
        ([1.0, 2.0**53], r"^a row 1: too large for 64 bits"),
        ([0.0, np.inf], r"^a row 1: too large for 64 bits"),
        ([0.0, np.nan], r"^a row 1: not a whole number"),
        ([1.0, 2.5], r"^a row 1: not a whole number"),
        ([1, 2**70], r"^a: not an array of whole numbers"),
        ([1j], r"^a: not an array of whole numbers"),
    ],
)
def test_integers(values, message):
    with pytest.raises(ValueError, match=message):
        as_ints("a", values)


def test_small_integers_do_not_wrap():
    """200 + 100 is 44 in 8 bits: boxes, ids and poses in bytes are what they say."""
    xyxy = np.array([[200, 100, 250, 255]], dtype=np.uint8)
    boxes = dq.Detections.from_xyxy(np.array([200], dtype=np.uint8), xyxy)
    assert boxes.box.tolist() == [[199.5, 99.5, 249.5, 254.5]]
    assert boxes.pose.tolist() == [200]
    path = np.array([[250, 0, 0], [10, 0, 0]], dtype=np.uint8)
    odometry = dq.Odometry.from_poses(path, covariance=np.eye(3, dtype=np.uint8))
    assert odometry.relative.tolist() == [[-240.0, 0.0, 0.0]]
    assert as_ints("a", np.array([2**63 - 1], dtype=np.uint64)).tolist() == [2**63 - 1]


@pytest.mark.parametrize("variance", [1e-25, 1e33, 1e160])
def test_variances(variance):
    with pytest.raises(ValueError, match=r"^a row 1: variance not between 1e-24 and 1e\+32"):
        as_covariances("a", [np.eye(3), variance * np.eye(3)], 2, 3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: odometry([[0, 0, 0], [1e9, 0, 0]]), r"^poses row 1: beyond 1e\+08 m"),
        (lambda: odometry([[0, 0, 0], [1, 0, 1e308]]), r"^poses row 1: beyond 1e\+06 rad"),
        (lambda: odometry([[0, 0, 0], [1, 0, 1j]]), r"^poses row 0: complex"),
        (lambda: box([0, 0, 1e7, 9]), r"^detections.box row 0: beyond 1e\+06 px"),
        (lambda: box([0, 0, 9, 9], object_id=[2**62 + 1]), r"object_id row 0: not an object id"),
    ],
)
def test_recordings(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def odometry(poses):
    return dq.Odometry.from_poses(poses, covariance=np.eye(3))


def box(corners, **more):
    return dq.Detections.from_xyxy([0], [corners], **more)
