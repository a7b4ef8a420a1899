"""Maps from folders, map.json and CSV."""

import json

import numpy as np
import pytest

import dqslam as dq
from dqslam.io import FileError
from dqslam.places import read_landmarks


def write(tmp_path, text):
    path = tmp_path / "map.csv"
    path.write_text(text)
    return path


def test_a_csv_has_classes_and_centers_and_rows_for_ids(tmp_path):
    found = read_landmarks(write(tmp_path, "class_id,x,y,z\n-2,1.5,2,3\nchair,4,5,6\n"))
    assert found.class_names == ("-2", "chair")
    assert found.object_ids.tolist() == [0, 1]
    assert found.centers.tolist() == [[1.5, 2.0, 3.0], [4.0, 5.0, 6.0]]
    assert np.isnan(found.covariances).all() and np.isnan(found.semi_axes).all()
    assert not found.shares_errors


def test_sizes_are_halved_and_covariances_made_whole(tmp_path):
    text = (
        "id,class,z,y,x,sx,sy,sz,cxx,cxy,cxz,cyy,cyz,czz\n"
        "7,car,3,2,1,1,4,2,0.04,0.01,0,0.09,0,0.01\n"
        "9,car,0,0,0,,,,,,,,,\n"
    )
    found = read_landmarks(write(tmp_path, text))
    assert found.object_ids.tolist() == [7, 9]
    assert found.centers[0].tolist() == [1.0, 2.0, 3.0]
    assert found.semi_axes[0].tolist() == [2.0, 1.0, 0.5]
    assert found.covariances[0].tolist() == [[0.04, 0.01, 0.0], [0.01, 0.09, 0.0], [0.0, 0.0, 0.01]]
    assert found.has_covariance.tolist() == [True, False]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y,z\n1,2,3\n", "map.csv:1: no column class_id"),
        ("class_id,x,y\n1,2,3\n", "map.csv:1: no column z"),
        ("class_id,x,y,z\n1,2,3,4\n1,2,?,4\n", r"map.csv:3: y is '\?', not a number"),
        ("class_id,x,y,z\n1,2,3,1e9\n", "map.csv:2: the center is beyond"),
        ("id,class_id,x,y,z\n5,1,2,3,4\n5,1,2,3,5\n", "map.csv:3: object 5 occurs twice"),
        ("class_id,x,y,z,sx,sy,sz\n1,2,3,4,1,-1,1\n", "map.csv:2: .* not positive"),
        ("class_id,x,y,z,sx,sy,sz\n1,2,3,4,1,,1\n", "map.csv:2: some of sx sy sz are empty"),
        ("class_id,x,y,z,cxx\n1,2,3,4,1\n", "map.csv:1: no column cxy"),
        (
            "class_id,x,y,z,cxx,cxy,cxz,cyy,cyz,czz\n1,0,0,0,1,2,0,1,0,1\n",
            "map.csv:2: covariance is not positive definite",
        ),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path, text, message):
    with pytest.raises(FileError, match=message):
        read_landmarks(write(tmp_path, text))


def test_a_folder_and_its_map_are_the_same_objects(tmp_path, paper):
    recording, estimate, marginals = paper
    dq.save_estimate(estimate, tmp_path / "results", marginals=marginals)
    folder = read_landmarks(tmp_path / "results")
    file = read_landmarks(tmp_path / "results" / "map.json")
    memory = read_landmarks(estimate)
    for other in (file, memory):
        assert folder.object_ids.tolist() == other.object_ids.tolist()
        np.testing.assert_allclose(folder.centers, other.centers, atol=1e-12)
        np.testing.assert_allclose(folder.semi_axes, other.semi_axes, atol=1e-12)
    np.testing.assert_allclose(folder.covariances, marginals.centers, rtol=1e-12)
    assert folder.shares_errors and folder.results is not None and file.results is None
    assert len(folder.results.poses) == len(estimate.poses)


def test_an_empty_map_and_a_wrong_type_are_refused(tmp_path):
    (tmp_path / "map.json").write_text(json.dumps({"objects": []}))
    with pytest.raises(FileError, match="map.json: holds no object"):
        read_landmarks(tmp_path / "map.json")
    with pytest.raises(TypeError, match="a map is a folder .* not int"):
        read_landmarks(3)


@pytest.fixture(scope="module")
def paper():
    recording, _ = dq.simulate(dq.load_scenario("paper"), seed=7)
    graph = dq.build_graph(recording)
    estimate, _ = dq.solve(graph)
    return recording, estimate, dq.marginal_covariances(graph, estimate)
