import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import planted
from dqslam.io import FileError, load_results, write_ply
from dqslam.solids import unit_sphere

COLORS = [(10 * k, 20, 30) for k in range(5)]
PATH_COLOR = (213, 94, 0)


@pytest.fixture
def results(tmp_path):
    return load_results(planted.write_planted(tmp_path).results)


def read(path):
    """Return the elements of an ASCII PLY file, by name."""
    lines = iter(path.read_text().splitlines())
    assert [next(lines), next(lines)] == ["ply", "format ascii 1.0"]
    counts = {}
    for line in lines:
        words = line.split()
        if words[0] == "element":
            counts[words[1]] = int(words[2])
        if words[0] == "end_header":
            break
    tables = {
        name: np.array([next(lines).split() for _ in range(n)], float) for name, n in counts.items()
    }
    assert next(lines, None) is None
    return tables


def volume(vertices, faces):
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def test_the_sphere_is_closed_and_looks_outwards():
    vertices, faces = unit_sphere()
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1.0)
    edges = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    assert len(np.unique(edges, axis=0)) == len(edges)  # each once in each direction
    np.testing.assert_array_equal(np.unique(edges, axis=0), np.unique(edges[:, ::-1], axis=0))
    assert len(vertices) - len(edges) / 2 + len(faces) == 2  # Euler
    assert 0.97 * 4.0 / 3.0 * np.pi < volume(vertices, faces) < 4.0 / 3.0 * np.pi


def test_vertices_lie_on_their_ellipsoids_and_the_path_joins_its_poses(tmp_path, results):
    write_ply(tmp_path / "map.ply", results, COLORS, PATH_COLOR)
    tables = read(tmp_path / "map.ply")
    vertices, faces = tables["vertex"], tables["face"].astype(int)
    objects = results.objects
    for row, number in enumerate(objects.object_ids):
        mine = vertices[:, 6] == number
        turn = Rotation.from_quat(objects.orientations[row])
        inside = (
            turn.inv().apply(vertices[mine, :3] - objects.centers[row]) / objects.semi_axes[row]
        )
        np.testing.assert_allclose(np.linalg.norm(inside, axis=1), 1.0, atol=1e-4)
        assert (vertices[mine, 3:6] == COLORS[row]).all()
        held = faces[np.isin(faces[:, 1], np.flatnonzero(mine)), 1:]
        assert (faces[:, 0] == 3).all()
        expected = 4.0 / 3.0 * np.pi * np.prod(objects.semi_axes[row])
        assert volume(vertices[:, :3] - objects.centers[row], held) == pytest.approx(
            expected, rel=0.03
        )
    path = vertices[:, 6] == -1
    np.testing.assert_allclose(vertices[path, :3], results.poses[:, :3], atol=1e-6)
    first, second = vertices[tables["edge"].astype(int)].swapaxes(0, 1)
    np.testing.assert_allclose(first[:, :3], results.poses[:-1, :3], atol=1e-6)
    np.testing.assert_allclose(second[:, :3], results.poses[1:, :3], atol=1e-6)


def test_trimesh_reads_it(tmp_path, results):
    trimesh = pytest.importorskip("trimesh")
    write_ply(tmp_path / "map.ply", results, COLORS, PATH_COLOR)
    mesh = trimesh.load(tmp_path / "map.ply", process=False)
    expected = 4.0 / 3.0 * np.pi * np.prod(results.objects.semi_axes, axis=1).sum()
    assert mesh.volume == pytest.approx(expected, rel=0.03)
    assert mesh.visual.vertex_colors[-1, :3].tolist() == list(PATH_COLOR)


def test_what_is_no_ellipsoid_is_a_point(tmp_path, results):
    results.objects.semi_axes[2] = np.nan
    write_ply(tmp_path / "map.ply", results, COLORS, PATH_COLOR)
    tables = read(tmp_path / "map.ply")
    mine = tables["vertex"][tables["vertex"][:, 6] == results.objects.object_ids[2]]
    np.testing.assert_allclose(mine[:, :3], results.objects.centers[[2]], atol=1e-6)
    assert len(tables["face"]) == 4 * len(unit_sphere()[1])


def test_bad_calls(tmp_path, results):
    with pytest.raises(ValueError, match="colors: expected 5, got 4"):
        write_ply(tmp_path / "map.ply", results, COLORS[:4], PATH_COLOR)
    (tmp_path / "file").write_text("x")
    with pytest.raises(FileError, match=r"map.ply: cannot be written"):
        write_ply(tmp_path / "file" / "map.ply", results, COLORS, PATH_COLOR)
