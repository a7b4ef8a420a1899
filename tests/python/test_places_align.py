"""The motion between two maps, and when it cannot be told."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam.metrics import align_rigid
from dqslam.places.alignment.search import _different
from planted_maps import landmarks, motion, moved, strewn, two_maps
from realdata import recording

B_FROM_A = motion(2.0, (40.0, -70.0, 1.5))


def aligned(a, b, **options):
    return dq.align(landmarks(a), landmarks(b), **options)


def displacement(found, truth, points):
    return np.abs(moved(found, points) - moved(truth, points)).max()


@pytest.mark.parametrize("seed", range(4))
def test_a_third_of_the_objects_is_enough(seed):
    a, b = two_maps(seed, shared=9, others=11, sigma=0.05, b_from_a=B_FROM_A)
    found = aligned(a, b)
    assert found.motion == "se2"
    # Ids begin at 100, and B has its objects in the reverse order.
    right = {(100 + row, 100 + 19 - row) for row in range(9)}
    pairs = set(zip(found.a_ids.tolist(), found.b_ids.tolist(), strict=True))
    assert right <= pairs and len(pairs) <= 11
    assert displacement(found.b_from_a, B_FROM_A, a[:9]) < 0.2
    np.testing.assert_allclose(found.b_from_a[2, :3], [0.0, 0.0, 1.0], atol=1e-12)


def test_maps_without_noise_give_the_exact_motion():
    a, b = two_maps(1, shared=12, others=0, sigma=0.0, b_from_a=B_FROM_A)
    found = aligned(a, b)
    np.testing.assert_allclose(found.b_from_a, B_FROM_A, atol=1e-8)
    assert len(found) == 12 and found.rms_m < 1e-8


def test_the_other_direction_is_the_inverse():
    a, b = two_maps(2, shared=12, others=8, sigma=0.05, b_from_a=B_FROM_A)
    product = aligned(b, a).b_from_a @ aligned(a, b).b_from_a
    assert displacement(product, np.eye(4), a[:12]) < 0.05


def test_the_result_does_not_depend_on_the_frames():
    a, b = two_maps(3, shared=12, others=8, sigma=0.05, b_from_a=B_FROM_A)
    first, second = motion(0.7, (5.0, 200.0, -3.0)), motion(-2.5, (-90.0, 3.0, 0.0))
    plain = aligned(a, b).b_from_a
    other = aligned(moved(first, a), moved(second, b)).b_from_a
    assert displacement(np.linalg.inv(second) @ other @ first, plain, a) < 1e-5


def test_maps_in_space_need_no_gravity():
    random = np.random.default_rng(5)
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec([0.9, -0.4, 1.7]).as_matrix()
    turn[:3, 3] = [3.0, 1.0, -8.0]
    a, b = random.uniform(0.0, 20.0, (2, 25, 3))
    b[:12] = a[:12] + random.normal(0.0, 0.05, (12, 3))
    b = moved(turn, b)
    found = aligned(a, b)
    assert found.motion == "se3" and len(found) >= 12
    assert displacement(found.b_from_a, turn, a[:12]) < 0.2
    oracle = align_rigid(a[:12], b[:12])
    np.testing.assert_allclose(found.b_from_a[:3, :3], oracle.rotation, atol=5e-3)


def test_the_scale_is_found_where_it_is_asked_for():
    truth = motion(1.0, (2.0, 3.0, 0.0), scale=2.5)
    a, b = two_maps(4, shared=12, others=6, sigma=0.02, b_from_a=truth)
    found = aligned(a, b, scale=True)
    assert abs(found.scale - 2.5) < 5.0 * 2.5 * found.scale_sigma < 0.1
    assert displacement(found.b_from_a, truth, a[:12]) < 0.3
    with pytest.raises(dq.CannotTellError):
        aligned(a, b)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("shared", [0, 2])
def test_unrelated_maps_and_two_common_objects_are_refused(seed, shared):
    a, b = two_maps(seed, shared=shared, others=20, sigma=0.02, b_from_a=B_FROM_A)
    with pytest.raises(dq.CannotTellError, match=r"chance|lie to each other"):
        aligned(a, b)


def test_fewer_than_three_objects_or_no_common_class_are_refused():
    a = strewn(np.random.default_rng(0), 8)
    with pytest.raises(dq.CannotTellError, match="has 2 objects .* 3 are needed"):
        aligned(a, a[:2])
    with pytest.raises(dq.CannotTellError, match="no class is in both maps: car; tree"):
        dq.align(landmarks(a), landmarks(a, ["tree"] * 8))


def parked(random):
    rows = np.stack(np.meshgrid(2.7 * np.arange(6), 6.0 * np.arange(4)), axis=-1).reshape(-1, 2)
    return np.column_stack([rows, np.zeros(24)]) + random.normal(0.0, 0.1, (24, 3))


def test_a_grid_is_ambiguous_until_something_breaks_its_symmetry():
    random = np.random.default_rng(1)
    a, b = parked(random), moved(B_FROM_A, parked(random))
    with pytest.raises(dq.CannotTellError, match=r"another motion .* degrees and .* m, or .* m"):
        aligned(a, b)
    trees = np.array([[3.0, 30.0, 0.0], [20.0, -9.0, 0.0], [-8.0, 5.0, 0.0]])
    classes = ["car"] * 24 + ["tree"] * 3
    found = dq.align(
        landmarks(np.vstack([a, trees]), classes),
        landmarks(np.vstack([b, moved(B_FROM_A, trees)]), classes),
    )
    assert len(found) == 27
    assert displacement(found.b_from_a, B_FROM_A, a) < 0.2
    assert found.runner_up is not None and found.runner_up.pairs < 27


def test_parts_of_a_row_that_overlap_are_not_laid_onto_each_other():
    random = np.random.default_rng(2)
    row = np.column_stack([3.0 * np.arange(20), np.zeros(20), np.zeros(20)])
    a, b = row[:14], moved(B_FROM_A, row[6:])
    with pytest.raises(dq.CannotTellError):
        aligned(a + random.normal(0, 0.1, a.shape), b + random.normal(0, 0.1, b.shape))


def test_the_covariance_is_that_of_the_errors():
    squares = []
    for seed in range(40):
        a, b = two_maps(seed, shared=15, others=5, sigma=0.05, b_from_a=B_FROM_A)
        covariances = np.tile(0.05**2 * np.eye(3), (20, 1, 1))
        found = dq.align(
            landmarks(a, covariances=covariances), landmarks(b, covariances=covariances)
        )
        error = np.linalg.inv(B_FROM_A) @ found.b_from_a
        local = np.append(error[:3, 3], np.arctan2(error[1, 0], error[0, 0]))
        rows = [0, 1, 2, 5]
        inverse = np.linalg.inv(found.covariance[np.ix_(rows, rows)])
        squares.append(local @ inverse @ local / 4.0)
    assert 0.7 < np.mean(squares) < 1.4  # 0.79 to 1.23 of 160 degrees of freedom, were it exact


def test_errors_of_a_whole_map_are_in_the_covariance():
    a, b = two_maps(0, shared=15, others=0, sigma=0.01, b_from_a=np.eye(4))
    local, turn = 0.01**2 * np.eye(3), 0.03
    arm = np.stack([-a[:, 1], a[:, 0], np.zeros(15)], axis=1)
    covariances = local + turn**2 * arm[:, :, None] * arm[:, None, :]
    shared = dq.align(landmarks(a, covariances=covariances, shares_errors=True), landmarks(b))
    assert abs(np.sqrt(shared.covariance[5, 5]) - turn) < 0.1 * turn
    alone = dq.align(landmarks(a, covariances=covariances), landmarks(b))
    assert np.sqrt(alone.covariance[5, 5]) < 0.5 * turn


def test_wrong_options_are_refused():
    a = landmarks(strewn(np.random.default_rng(0), 8))
    with pytest.raises(ValueError, match="sigma is -1 m, not positive"):
        dq.align(a, a, sigma=-1.0)
    with pytest.raises(ValueError, match="motion is 'sim3', not auto, se2 or se3"):
        dq.align(a, a, motion="sim3")


def test_three_robots_on_a_real_car_park_agree_around_a_loop():
    folder = recording("slideslam_maps") / "parking"
    one, two, three = (folder / f"robot{number}.csv" for number in range(3))
    loop = np.eye(4)
    for a, b in ((one, two), (two, three), (three, one)):
        loop = dq.align(a, b).b_from_a @ loop
    assert np.degrees(abs(np.arctan2(loop[1, 0], loop[0, 0]))) < 0.07
    middle = np.append(dq.read_landmarks(one).centers.mean(axis=0), 1.0)
    assert np.hypot(*(loop @ middle - middle)[:2]) < 0.04


def tables(random):
    """Return tables with four chairs each, which all are alike, and their classes."""
    middle, turn = random.uniform(0.0, 20.0, (7, 2)), random.uniform(0.0, np.pi, 7)
    corner = np.array([[0.8, 0.5], [-0.8, 0.5], [0.8, -0.5], [-0.8, -0.5]])
    places, classes = list(middle), ["table"] * 7
    for place, angle in zip(middle, turn, strict=True):
        own = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        places += list(place + (corner + random.normal(0.0, 0.08, (4, 2))) @ own.T)
        classes += ["chair"] * 4
    height = np.where(np.array(classes) == "table", 0.4, 0.5)
    return np.column_stack([places, height + random.normal(0.0, 0.03, len(classes))]), classes


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_map_upside_down_is_turned_over_or_refused(seed):
    """Groups that repeat agree about upright motions, too, with less evidence."""
    random = np.random.default_rng(seed)
    places, classes = tables(random)
    over = np.diag([1.0, -1.0, -1.0, 1.0])
    over[:3, 3] = [7.0, 2.0, -1.0]
    maps = []
    for matrix in (np.eye(4), over):
        rows = np.flatnonzero(random.random(len(classes)) < 0.8)
        seen = moved(matrix, places[rows] + random.normal(0.0, 0.05, (len(rows), 3)))
        maps.append(landmarks(seen, [classes[row] for row in rows]))
    try:
        found = dq.align(*maps)
    except dq.CannotTellError:
        return
    assert found.motion == "se3"
    np.testing.assert_allclose(found.b_from_a[:3, :3], over[:3, :3], atol=0.05)


def test_motions_that_pair_objects_alike_are_one():
    """By hand: the second shares two of three pairs of the first, the third one, the last none."""
    partner = np.array([[0, 1, 2, -1], [0, 1, 5, 7], [0, 4, 6, 3], [-1, -1, -1, -1], [9, 9, 9, 9]])
    np.testing.assert_array_equal(_different(partner, 10), [0, 2, 3, 4])
    np.testing.assert_array_equal(_different(partner, 2), [0, 2])
