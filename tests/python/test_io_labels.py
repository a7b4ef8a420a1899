"""Ids and classes are names."""

import pytest

from dqslam.io import InputWarning, read_detections
from dqslam.io.labels import LabelError, numbered

HEADER = "frame,timestamp,x1,y1,x2,y2,score,class_id,class_name,track_id"


@pytest.mark.parametrize(
    ("labels", "numbers"),
    [
        (["7", "3", "7", ""], [7, 3, 7, -1]),
        (["5.0", "-1", "nan", "None"], [5, -1, -1, -1]),
        (["cup", "jar", "cup"], [0, 1, 0]),
        # A name among numbers makes all of them names.
        (["7", "b", "7"], [0, 1, 0]),
        # Two numbers of 20 digits that are one float.
        (["12345678901234567890", "12345678901234567891"], [0, 1]),
        (["9007199254740991", "9007199254740991"], [2**53 - 1] * 2),
        (["9007199254740993", "9007199254740992"], [0, 1]),
        (["6f1c2b", "1e300"], [0, 1]),
        (["-7", "-7"], [0, 0]),
    ],
)
def test_numbers_of_labels(labels, numbers):
    assert numbered(labels).tolist() == numbers


def test_classes_are_in_the_order_of_names():
    assert numbered(["jar", "cup"], by_name=True).tolist() == [1, 0]


@pytest.mark.parametrize("label", ["3.5", "1.2345678901234567e+19"])
def test_a_fraction_is_neither(label):
    with pytest.raises(LabelError, match="not a whole number") as error:
        numbered(["1", label])
    assert error.value.row == 1


def read(tmp_path, *rows, header=HEADER, **more):
    path = tmp_path / "boxes.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return read_detections(path, width=640, height=480, **more)


def test_one_id_with_several_names_is_several_classes(tmp_path):
    rows = [f"{i},{i},10,20,30,50,0.9,0,{name},{i}" for i, name in enumerate(["jar", "cup", "jar"])]
    with pytest.warns(InputWarning, match=r"class_id 0 has 2 names \(jar, cup\): the names are"):
        table = read(tmp_path, *rows)
    assert table.class_id.tolist() == [1, 0, 1]
    assert table.class_name == ("jar", "cup", "jar")
    # Names that the user gives are believed.
    assert read(tmp_path, *rows, classes={0: "thing"}).class_name == ("thing",) * 3


def test_one_name_of_two_ids_is_noted(tmp_path):
    rows = ["0,0,10,20,30,50,0.9,0,cup,1", "1,1,10,20,30,50,0.9,4,cup,1"]
    with pytest.warns(InputWarning, match=r"2 class_ids are named cup \(0, 4\)"):
        assert read(tmp_path, *rows).class_id.tolist() == [0, 4]


def test_words_as_class_ids_and_uuids_as_tracks(tmp_path):
    rows = [
        "0,0,10,20,30,50,0.9,jar,,1b4e28ba-2fa1-11d2-883f-0016d3cca427",
        "1,1,10,20,30,50,0.9,cup,,6fa459ea-ee8a-3ca4-894e-db77e160355e",
        "2,2,10,20,30,50,0.9,cup,,1b4e28ba-2fa1-11d2-883f-0016d3cca427",
    ]
    table = read(tmp_path, *rows)
    assert table.class_id.tolist() == [1, 0, 0]
    assert table.class_name == ("jar", "cup", "cup")
    assert table.track_id.tolist() == [0, 1, 0]


def test_names_without_ids_and_neither(tmp_path):
    header = "timestamp,x1,y1,x2,y2,name"
    table = read(tmp_path, "0,1,2,3,4,jar", "1,1,2,3,4,cup", header=header)
    assert (table.class_id.tolist(), table.class_name) == ([1, 0], ("jar", "cup"))
    table = read(tmp_path, "0,1,2,3,4", "1,1,2,3,4", header=header.removesuffix(",name"))
    assert (table.class_id.tolist(), table.class_name) == ([0, 0], ("object", "object"))
    assert (table.score.tolist(), table.track_id) == ([1, 1], None)
