"""The figure of where cameras are in a map."""

import numpy as np
import pytest

import dqslam as dq
from dqslam.places.landmarks import read_landmarks
from dqslam.places.locate_files import ImageLocation
from dqslam.plot.locations import draw_locations
from small_place import CENTERS, LENS, NAMES, boxes_at, pose_at, write_map

POSE = pose_at(1.3, -2.2, 0.9)


def located(folder, count):
    """Locate the image at POSE by its first boxes."""
    kinds = sorted(set(NAMES))
    boxes = dq.Detections(
        pose=np.zeros(count, dtype=int),
        box=boxes_at(POSE)[:count],
        score=np.full(count, 0.9),
        class_id=np.array([kinds.index(name) for name in NAMES[:count]]),
        object_id=np.full(count, -1),
        class_names=dict(enumerate(kinds)),
    )
    return ImageLocation(0.0, count, dq.locate(folder, boxes, LENS))


def test_an_answer_is_where_it_is_and_looks_at_the_table(tmp_path):
    folder = write_map(tmp_path / "map")
    answer = located(folder, len(NAMES))
    assert answer.location.is_found
    axes = draw_locations(read_landmarks(folder), [answer]).axes[0]
    look, place, ellipse = (np.asarray(one.get_xydata()) for one in axes.lines[-3:])
    shown = {axes.get_xlabel(), axes.get_ylabel()}
    assert shown == {"x [m]", "y [m]"}
    order = [0, 1] if axes.get_xlabel() == "x [m]" else [1, 0]
    np.testing.assert_allclose(place[0], POSE[order], atol=0.05)
    np.testing.assert_allclose(ellipse[:-1].mean(axis=0), place[0], atol=1e-6)
    # The camera looks at the origin.
    ahead, inward = look[1] - look[0], -place[0]
    lengths = np.linalg.norm(ahead) * np.linalg.norm(inward)
    assert ahead @ inward > 0.998 * lengths
    # The half axes of 95 %: 2.45 sigmas.
    half = np.linalg.norm(ellipse - place[0], axis=1)
    sigmas = np.sqrt(np.linalg.eigvalsh(answer.location.covariance[:3, :3]))
    assert half.max() <= 2.45 * sigmas[-1] * (1.0 + 1e-9)
    assert half.min() >= 2.45 * sigmas[0] * (1.0 - 1e-9)
    circles = [one.get_xydata() for one in axes.lines[-3 - len(NAMES) : -3]]
    middles = np.array([one[:-1].mean(axis=0) for one in circles])
    np.testing.assert_allclose(middles, CENTERS[:, order], atol=1e-6)


def test_an_image_without_an_answer_has_crosses_only(tmp_path):
    folder = write_map(tmp_path / "map")
    answer = located(folder, 2)
    assert not answer.location.is_found
    axes = draw_locations(read_landmarks(folder), [answer]).axes[0]
    crosses = [one for one in axes.lines if one.get_marker() == "x"]
    assert len(crosses) == len(answer.location.candidates)
    assert not [one for one in axes.lines if one.get_marker() == "."]
    assert axes.get_title(loc="left").startswith("0 of 1 located")
    for cross, rival in zip(crosses, answer.location.candidates, strict=True):
        assert cross.get_alpha() == pytest.approx(0.2 + 0.8 * rival.probability)
