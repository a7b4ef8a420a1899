"""Objects that hide parts of others."""

import numpy as np
import pytest

import oracle
from dqslam import _core, load_scenario, simulate
from dqslam.simulation.detector import hide, seen_box

PAPER = load_scenario("paper")
SQUARE = np.array([0.0, 0.0, 10.0, 10.0])


def rectangle(u_min, v_min, u_max, v_max):
    """A closed polygon."""
    corners = [(u_min, v_min), (u_max, v_min), (u_max, v_max), (u_min, v_max), (u_min, v_min)]
    return np.array(corners, dtype=np.float64)


def ellipse(center, axes, turn=0.0, count=400):
    angle = np.linspace(0.0, 2.0 * np.pi, count + 1)
    c, s = np.cos(turn), np.sin(turn)
    points = np.column_stack([axes[0] * np.cos(angle), axes[1] * np.sin(angle)])
    return center + points @ np.array([[c, s], [-s, c]])


@pytest.mark.parametrize(
    ("before", "box", "hidden"),
    [
        ([(-5.0, -5.0, 5.0, 15.0)], [5.0, 0.0, 10.0, 10.0], 0.5),  # the left half
        ([(-5.0, 8.0, 15.0, 99.0)], [0.0, 0.0, 10.0, 8.0], 0.2),  # the lowest fifth
        ([(5.0, 5.0, 15.0, 15.0)], SQUARE, 0.25),  # a corner: all edges are still touched
        ([(4.0, -1.0, 6.0, 11.0)], SQUARE, 0.2),  # a strip in the middle
        ([(-1.0, -1.0, 4.0, 11.0), (3.0, -1.0, 6.0, 11.0)], [6.0, 0.0, 10.0, 10.0], 0.6),
        ([(6.0, -1.0, 11.0, 11.0), (-1.0, -1.0, 2.0, 11.0)], [2.0, 0.0, 6.0, 10.0], 0.6),
        ([(2.0, 2.0, 5.0, 5.0), (4.0, 2.0, 7.0, 5.0)], SQUARE, 0.15),  # they overlap
        ([(-1.0, -1.0, 11.0, 11.0)], SQUARE, 1.0),
        ([(-1.0, -1.0, 5.0, 11.0), (5.0, -1.0, 11.0, 11.0)], SQUARE, 1.0),
        ([(20.0, 0.0, 30.0, 10.0)], SQUARE, 0.0),
    ],
)
def test_what_is_seen_of_a_square_by_hand(before, box, hidden):
    seen, share = seen_box(SQUARE, rectangle(*SQUARE), [rectangle(*one) for one in before])
    np.testing.assert_allclose(seen, box, atol=0.05)
    assert share == pytest.approx(hidden, abs=0.01)


def test_what_is_seen_of_ellipses_is_what_a_raster_shows():
    random = np.random.default_rng(0)
    u, v = np.meshgrid(np.linspace(-40.0, 40.0, 801), np.linspace(-40.0, 40.0, 801))
    compared = 0
    for _ in range(30):
        axes, turns = random.uniform(5.0, 20.0, (3, 2)), random.uniform(0.0, np.pi, 3)
        centers = np.vstack([[0.0, 0.0], random.uniform(-20.0, 20.0, (2, 2))])
        outlines = [ellipse(*one) for one in zip(centers, axes, turns, strict=True)]
        inside = []
        for center, (a, b), turn in zip(centers, axes, turns, strict=True):
            x, y = u - center[0], v - center[1]
            along = np.cos(turn) * x + np.sin(turn) * y
            across = np.cos(turn) * y - np.sin(turn) * x
            inside.append((along / a) ** 2 + (across / b) ** 2 <= 1.0)
        visible = inside[0] & ~inside[1] & ~inside[2]
        low, high = outlines[0].min(axis=0), outlines[0].max(axis=0)
        seen, hidden = seen_box(np.concatenate([low, high]), outlines[0], outlines[1:])
        assert hidden == pytest.approx(1.0 - visible.sum() / inside[0].sum(), abs=0.02)
        if visible.sum() > 200:
            raster = [u[visible].min(), v[visible].min(), u[visible].max(), v[visible].max()]
            # Cells of 0.1; an edge within two lines of the whole box's snaps to it.
            np.testing.assert_allclose(seen, raster, atol=0.1 + 2.5 * max(high - low) / 200.0)
            compared += 1
    assert compared > 20


def test_only_the_nearer_object_hides_the_other():
    box = np.array([[SQUARE, [5.0, 5.0, 15.0, 15.0], [100.0, 0.0, 110.0, 10.0]]])
    shapes = [rectangle(*one) for one in box[0]]
    everything = np.ones((1, 3), dtype=np.bool_)
    distance = np.array([[2.0, 1.0, 1.5]])
    calls = []

    def outline(pose, row):
        calls.append((pose, row))
        return shapes[row]

    seen, enough = hide(box, everything, everything, distance, outline, 0.3)
    np.testing.assert_array_equal(seen, box)
    assert enough.tolist() == [[True, True, True]]  # a quarter of the first is hidden
    assert sorted(calls) == [(0, 0), (0, 1)]
    _, enough = hide(box, everything, everything, distance, outline, 0.2)
    assert enough.tolist() == [[False, True, True]]
    wanted = np.array([[False, True, True]])
    _, enough = hide(box, everything, wanted, distance, outline, 0.2)
    assert enough.all()


@pytest.mark.parametrize("objects", ["ellipsoids", "cubes", "cuboids"])
def test_boxes_of_a_crowd_are_those_of_sampled_surfaces(objects):
    """Points of a surface that a ray meets after no nearer body bound what is seen."""
    settings = {"edge_sigma_px": 0.0, "occlusion_max_hidden": 0.9, "min_side_px": 50.0}
    crowd = PAPER.model_copy(
        update={
            "objects": objects,
            "detector": PAPER.detector.model_copy(update=settings),
            "world": PAPER.world.model_copy(update={"object_count": 25}),
            "path": PAPER.path.model_copy(update={"laps": 1}),
        }
    )
    free = crowd.detector.model_copy(update={"occlusion_max_hidden": None})
    hidden, truth = simulate(crowd, seed=1)
    whole, all_seen = simulate(crowd.model_copy(update={"detector": free}), seed=1)
    exact = by_pair(whole, all_seen)
    part = by_pair(hidden, truth)
    assert part.keys() <= exact.keys() | part.keys()
    shrunk = [pair for pair in part.keys() & exact.keys() if (part[pair] != exact[pair]).any()]
    assert len(shrunk) > 20
    for pair in shrunk:
        assert (part[pair][:2] >= exact[pair][:2]).all()
        assert (part[pair][2:] <= exact[pair][2:]).all()
    assert not hidden.detections.truncated.any()
    assert len(exact.keys() - part.keys()) > 0
    if objects == "ellipsoids":
        for pair in sorted(shrunk)[::10]:
            np.testing.assert_allclose(part[pair], sampled_box(hidden, truth, pair), atol=3.0)


def by_pair(recording, truth):
    keys = zip(recording.detections.pose.tolist(), truth.box_object_id.tolist(), strict=True)
    return dict(zip(keys, recording.detections.box, strict=True))


def sampled_box(recording, truth, pair):
    """Box of the points of an ellipsoid whose pixels no nearer ellipsoid covers."""
    pose, shown = pair
    robot = oracle.se2_matrix(truth.poses[pose])
    bodies = [_core.axes_from_ellipsoid(one) for one in truth.ellipsoids]
    surfaces = [oracle.ellipsoid_surface(*body, count=120) for body in bodies]
    pixels, _ = oracle.to_pixels(recording.camera, robot, surfaces[shown])
    eye = (robot @ oracle.se3_matrix(recording.camera.robot_from_camera))[:3, 3]
    distance = np.linalg.norm(truth.centers - eye, axis=1)
    covered = np.zeros(len(pixels), dtype=np.bool_)
    for row, (center, axes, turn) in enumerate(bodies):
        if distance[row] < distance[shown]:
            # A ray meets the ellipsoid if it meets the unit sphere in its coordinates.
            rotation = oracle.quaternion_matrix(turn)
            start = (rotation.T @ (eye - center)) / axes
            ray = ((surfaces[shown] - eye) @ rotation) / axes
            b, a = ray @ start, (ray**2).sum(axis=1)
            covered |= (b**2 >= a * (start @ start - 1.0)) & (b < 0.0)
    seen = pixels[~covered]
    return np.concatenate([seen.min(axis=0), seen.max(axis=0)])
