"""Pose graphs: what is written, and what GTSAM makes of it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dqslam as dq
from dqslam import _core, io
from dqslam.cli import main

SE2, SE3 = dq.PoseModel.SE2, dq.PoseModel.SE3


def solved(name):
    recording, _ = dq.simulate(dq.load_scenario(name), seed=7)
    graph = dq.build_graph(recording)
    estimate, _ = dq.solve(graph)
    return graph, estimate


@pytest.fixture(scope="module", params=["paper", "orbit"])
def problem(request):
    return solved(request.param)


def lines(path, tag):
    return [line.split()[1:] for line in path.read_text().splitlines() if line.split()[0] == tag]


def small(model):
    """Two poses and a landmark, with a full covariance."""
    rng = np.random.default_rng(0)
    k = 6 if model == SE3 else 3
    root = rng.normal(size=(k, k))
    root3 = rng.normal(size=(3, 3))
    turn = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_quat().tolist()
    step = [1.0, 0.2, 0.3, *turn] if model == SE3 else [1.0, 0.2, 0.3]
    start = [0.0] * 6 + [1.0] if model == SE3 else [0.0] * 3
    edges = io.LandmarkEdges([1], [0], [[2.0, 0.5, 0.1]], [root3 @ root3.T + np.eye(3)])
    return io.PoseGraph(
        pose_model=model,
        poses=[start, step],
        from_pose=[0],
        to_pose=[1],
        relative=[step],
        covariance=[root @ root.T + np.eye(k)],
        landmark_ids=[41],
        landmarks=[[3.0, 1.0, 0.5]],
        landmark_edges=edges,
    )


@pytest.mark.parametrize("program", ["g2o", "gtsam"])
def test_lines_in_space(tmp_path, program):
    graph, path = small(SE3), tmp_path / "a.g2o"
    io.write_g2o(path, graph, program=program)
    assert lines(path, "VERTEX_SE3:QUAT")[1] == ["1", *map(repr, graph.poses[1].tolist())]
    assert lines(path, "VERTEX_TRACKXYZ") == [["2", "3.0", "1.0", "0.5"]]
    (edge,) = lines(path, "EDGE_SE3:QUAT")
    assert edge[:9] == ["0", "1", *map(repr, graph.relative[0].tolist())]
    information = np.zeros((6, 6))
    information[np.triu_indices(6)] = np.array(edge[9:], dtype=float)
    information += np.triu(information, 1).T
    # g2o: half the rotation vector, so that the covariance of rotations is a quarter.
    halves = np.diag([1, 1, 1, 0.5, 0.5, 0.5]) if program == "g2o" else np.eye(6)
    expected = halves @ graph.covariance[0] @ halves
    np.testing.assert_allclose(np.linalg.inv(information), expected, rtol=1e-9)
    (seen,) = lines(path, "EDGE_SE3_TRACKXYZ")
    assert seen[:6] == ["1", "2", "0", "2.0", "0.5", "0.1"]
    upper = np.linalg.inv(graph.landmark_edges.covariance[0])[np.triu_indices(3)]
    np.testing.assert_allclose(np.array(seen[6:], dtype=float), upper)
    assert ("FIX 0" in path.read_text()) == (program == "g2o")


def test_lines_on_the_plane(tmp_path):
    graph, path = small(SE2), tmp_path / "a.g2o"
    io.write_g2o(path, graph)
    assert lines(path, "VERTEX_SE2") == [["0", "0.0", "0.0", "0.0"], ["1", "1.0", "0.2", "0.3"]]
    assert lines(path, "VERTEX_XY") == [["2", "3.0", "1.0"]]
    (edge,) = lines(path, "EDGE_SE2")
    assert edge[:5] == ["0", "1", "1.0", "0.2", "0.3"]
    upper = np.linalg.inv(graph.covariance[0])[np.triu_indices(3)]
    np.testing.assert_allclose(np.array(edge[5:], dtype=float), upper)
    (seen,) = lines(path, "EDGE_SE2_XY")
    assert seen[:4] == ["1", "2", "2.0", "0.5"]
    upper = np.linalg.inv(graph.landmark_edges.covariance[0][:2, :2])[np.triu_indices(2)]
    np.testing.assert_allclose(np.array(seen[4:], dtype=float), upper)


def logarithm(pose):
    """GTSAM's logarithm: the translation of the twist is V^-1 t."""
    if len(pose) == 3:
        omega, translation = np.array([0, 0, pose[2]]), np.array([*pose[:2], 0.0])
    else:
        omega, translation = Rotation.from_quat(pose[3:]).as_rotvec(), pose[:3]
    angle = np.linalg.norm(omega)
    cross = np.cross(np.eye(3), omega)  # the matrix of the cross product with omega
    if angle < 1e-6:
        shrink = np.eye(3) - 0.5 * cross + cross @ cross / 12
    else:
        factor = 1 / angle**2 - (1 + np.cos(angle)) / (2 * angle * np.sin(angle))
        shrink = np.eye(3) - 0.5 * cross + factor * cross @ cross
    twist = np.concatenate([shrink @ translation, omega])
    return twist if len(pose) == 7 else twist[[0, 1, 5]]


def costs_by_hand(graph):
    """Half the sum of squares at the initial values, of pose edges and of landmark edges."""
    total, of_landmarks = 0.0, 0.0
    for a, b, measured, covariance in zip(
        graph.from_pose, graph.to_pose, graph.relative, graph.covariance, strict=True
    ):
        ab = _core.between(graph.pose_model, graph.poses[[a]], graph.poses[[b]])
        error = logarithm(_core.between(graph.pose_model, measured[None], ab)[0])
        total += 0.5 * error @ np.linalg.solve(covariance, error)
    edges = graph.landmark_edges
    if graph.pose_model == SE3:
        turn = Rotation.from_quat(graph.poses[edges.pose, 3:])
        local = turn.inv().apply(graph.landmarks[edges.landmark] - graph.poses[edges.pose, :3])
        error = local - edges.position
        weights = np.linalg.inv(edges.covariance)
        of_landmarks += 0.5 * np.einsum("mi,mij,mj->", error, weights, error)
    return total, of_landmarks


def test_gtsam_reads_the_same_cost(tmp_path, problem):
    gtsam = pytest.importorskip("gtsam", reason="needs gtsam")
    graph = dq.pose_graph(*problem)
    path = tmp_path / "drive.g2o"
    io.write_g2o(path, graph, program="gtsam")
    in_space = graph.pose_model == SE3
    factors, values = gtsam.readG2o(str(path), in_space)
    edges = len(graph.landmark_edges) if in_space else 0
    assert factors.size() == len(graph.relative) + edges
    assert values.size() == len(graph.poses) + len(graph.landmarks)
    between, of_landmarks = costs_by_hand(graph)
    assert between > 10
    each = [factors.at(row).error(values) for row in range(factors.size())]
    kinds = ["Between" in type(factors.at(row)).__name__ for row in range(factors.size())]
    assert sum(kinds) == len(graph.relative)
    np.testing.assert_allclose(np.sum(each, where=kinds), between, rtol=1e-9)
    # It takes positions of landmarks for directions and distances, which are the same at first
    # order only.
    np.testing.assert_allclose(
        sum(each) - np.sum(each, where=kinds), of_landmarks, rtol=2e-3, atol=1e-9
    )


def test_gtsam_agrees_with_the_estimate(tmp_path):
    # Boxes are positions only to first order, and shapes are held: its optimum is next to ours.
    gtsam = pytest.importorskip("gtsam", reason="needs gtsam")
    graph, estimate = solved("orbit")
    path = tmp_path / "drive.g2o"
    io.write_g2o(path, dq.pose_graph(graph, estimate), program="gtsam")
    factors, values = gtsam.readG2o(str(path), True)
    exact = gtsam.noiseModel.Isotropic.Sigma(6, 1e-6)
    factors.add(gtsam.PriorFactorPose3(0, values.atPose3(0), exact))
    moved = gtsam.LevenbergMarquardtOptimizer(factors, values).optimize()
    found = np.array([moved.atPose3(i).translation() for i in range(len(estimate.poses))])
    odometry = np.linalg.norm(estimate.initial_poses[:, :3] - estimate.poses[:, :3], axis=1)
    assert np.abs(found - estimate.poses[:, :3]).max() < 0.02 * odometry.max()


def test_positions_of_boxes_have_the_cost_of_the_boxes(problem):
    graph, estimate = problem
    model, core = graph.core.pose_model, graph.core
    used = np.zeros(len(core.boxes.pose), dtype=bool)
    used[::37] = True
    used &= ~core.boxes.truncated.any(axis=1) & estimate.inliers
    rows = np.flatnonzero(used)
    covariance = core.boxes.covariance.reshape(-1, 4, 4)
    found = io.positions_of_boxes(
        model,
        core.camera,
        estimate.poses,
        estimate.ellipsoids,
        pose=core.boxes.pose.astype(np.int64),
        landmark=core.boxes.object.astype(np.int64),
        box=core.boxes.box,
        covariance=covariance,
        used=used,
    )
    np.testing.assert_array_equal(found.pose, core.boxes.pose[rows])

    def costs(ellipsoids):
        here, objects = estimate.poses[found.pose], ellipsoids[found.landmark]
        box, _ = _core.project_to_boxes(model, core.camera, here, objects)
        error = core.boxes.box[rows] - box
        of_boxes = np.einsum("mi,mij,mj->m", error, np.linalg.inv(covariance[rows]), error)
        turn, origin = io.pose_graph.graph.rotations(model, here)
        local = np.einsum("mji,mj->mi", turn, objects[:, :3] - origin)
        error = local - found.position
        weights = np.linalg.inv(found.covariance)
        return of_boxes, np.einsum("mi,mij,mj->m", error, weights, error)

    boxes, positions = costs(estimate.ellipsoids)
    for shift in np.eye(3) * 1e-3:
        moved = estimate.ellipsoids.copy()
        moved[:, :3] += shift
        after_boxes, after_positions = costs(moved)
        change = after_boxes - boxes
        np.testing.assert_allclose(after_positions - positions, change, rtol=0.05, atol=0.02)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"to_pose": [2]}, "pose_graph.to_pose row 0: no such row"),
        ({"covariance": [np.zeros((6, 6))]}, "pose_graph.covariance row 0: covariance is not pos"),
        ({"landmarks": [[0, 0, np.nan]]}, "pose_graph.landmarks row 0: not finite"),
        ({"landmark_ids": [1, 2]}, r"pose_graph.landmark_ids: expected shape \(1\)"),
    ],
)
def test_wrong_graphs(changes, message):
    good = small(SE3)
    values = {name: getattr(good, name) for name in good.__dataclass_fields__}
    with pytest.raises(ValueError, match=message):
        io.PoseGraph(**values | changes)
    assert repr(good) == "PoseGraph(SE3, 2 poses, 1 edge, 1 landmark)"


def test_results_are_converted(tmp_path, capsys):
    recording, _ = dq.simulate(dq.load_scenario("orbit"), seed=1)
    io.save_recording(recording, tmp_path / "rec")
    files = [tmp_path / "rec" / name for name in ("camera.json", "odometry.txt", "boxes.csv")]
    dq.run_files(*files, out=tmp_path / "mine")
    out = tmp_path / "mine.g2o"
    assert main(["convert", str(tmp_path / "mine"), str(out)]) == 0
    assert "150 poses, 8 landmarks and" in capsys.readouterr().out
    results = dq.load_results(tmp_path / "mine")
    vertices = np.array([row[1:] for row in lines(out, "VERTEX_SE3:QUAT")], dtype=float)
    np.testing.assert_array_equal(vertices, results.poses)
    level = results.report["odometry_noise"]
    first = np.array(lines(out, "EDGE_SE3:QUAT")[0][9:], dtype=float)
    np.testing.assert_allclose(
        first[[0, 20]], [level["translation_m"] ** -2] + [4 * level["rotation_rad"] ** -2]
    )
    centers = np.array([row[1:] for row in lines(out, "VERTEX_TRACKXYZ")], dtype=float)
    np.testing.assert_array_equal(centers, results.objects.centers)
    assert len(lines(out, "EDGE_SE3_TRACKXYZ")) > 1000
    given = ["--odometry-covariance", str(tmp_path / "rec/odometry_covariance.csv")]
    assert main(["convert", str(tmp_path / "mine"), str(out), "--to", "gtsam", *given]) == 0
    first = np.array(lines(out, "EDGE_SE3:QUAT")[0][9:], dtype=float)
    assert first[0] == pytest.approx(1 / recording.odometry.covariance[0, 0, 0], rel=1e-6)


def test_without_the_accuracy_of_the_odometry_there_is_no_graph(tmp_path, capsys):
    _, estimate = solved("orbit")
    io.save_estimate(estimate, tmp_path / "mine")
    assert main(["convert", str(tmp_path / "mine"), str(tmp_path / "a.g2o")]) == 2
    assert "report.json: does not say how accurate the odometry is" in capsys.readouterr().err
    assert main(["convert", str(tmp_path / "mine"), str(tmp_path / "a.txt")]) == 2
    assert "it is of results; name a format with --to: g2o, gtsam, colmap-model" in (
        capsys.readouterr().err
    )
