"""The figure of where cameras are in a map."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

import dqslam as dq
from dqslam._colors import ORANGE, VERMILLION, class_colors
from dqslam.places.landmarks import read_landmarks
from dqslam.places.location.files import ImageLocation
from dqslam.plot.changes import draw_changes
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


def test_objects_have_the_colors_and_names_of_the_map(tmp_path):
    folder = write_map(tmp_path / "map")
    known = read_landmarks(folder)
    figure = draw_locations(known, [located(folder, len(NAMES)), located(folder, 2)])
    axes = figure.axes[0]
    colors = class_colors(NAMES)
    fills = [to_hex(one.get_facecolor()) for one in axes.patches]
    assert fills == [colors[name].lower() for name in NAMES]
    labels = {one.get_text(): one for one in axes.texts if one.get_gid() == "name"}
    assert set(labels) <= {f"{n} {k}" for n, k in zip(NAMES, known.object_ids, strict=True)}
    assert len(labels) >= 6
    for text, label in labels.items():
        tab = to_hex(label.get_bbox_patch().get_facecolor())
        assert tab == colors[text.rsplit(" ", 1)[0]].lower()
    (legend,) = figure.legends
    assert [one.get_text() for one in legend.get_texts()] == [
        "located, looks there, 95 %",
        "may be here: not sure",
        "cameras of the map",
        "object, by its mean radius",
    ]


def test_what_has_changed_has_its_color_and_id(tmp_path):
    """A book goes and a cup moves by 0.5 m: an arrow from where it was to where it is."""
    before = dq.load_results(write_map(tmp_path / "a"))
    centers = np.delete(CENTERS, 1, axis=0)
    centers[2] += [0.3, 0.4, 0.0]
    after = write_map(tmp_path / "b", centers, NAMES[:1] + NAMES[2:])
    found = dq.changes(before, after)
    (moved,), (gone,) = found.of("moved"), found.of("vanished")
    figure = draw_changes(found)
    axes = figure.axes[0]
    tabs = {
        one.get_text(): to_hex(one.get_bbox_patch().get_facecolor())
        for one in axes.texts
        if one.get_gid() == "name"
    }
    assert tabs[f"book A{gone.first_id}"] == VERMILLION.lower()
    assert tabs[f"cup B{moved.second_id}"] == ORANGE.lower()
    assert "cup A" not in " ".join(tabs)
    (arrow,) = [one for one in axes.texts if one.arrow_patch and not one.get_text()]
    shift = np.subtract(arrow.xy, arrow.xyann)
    np.testing.assert_allclose(np.sort(np.abs(shift)), [0.3, 0.4], atol=0.03)
    said = [one.get_text() for one in figure.legends[0].get_texts()]
    assert said == ["6 stayed", "1 moved", "1 vanished", "before", "later cameras"]
    assert axes.get_title(loc="left") == "from above, in the frame of the later map"
