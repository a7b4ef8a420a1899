"""Tables of where objects are."""

import numpy as np
import pytest

from dqslam import PlacementRule, PlacementRules, load_placements
from dqslam.assumptions import check_placement_classes
from dqslam.io import FileError

TABLE = """
up = [0, -2, 0]

[[placements]]
on = "plane"
sigma_m = 0.01

[[placements]]
class = "cup"
on = "desk"

[[placements]]
class = "keyboard"
beside = "monitor"
within_m = 0.6
sigma_m = 0.1

[[placements]]
class = "monitor"
aligned_with = "desk"
sigma_deg = 9

[[placements]]
class = "lamp"
upright = true
"""


def written(tmp_path, text):
    path = tmp_path / "placements.toml"
    path.write_text(text)
    return path


def test_a_table_by_hand(tmp_path):
    assert load_placements(written(tmp_path, TABLE)) == PlacementRules(
        (
            PlacementRule("on", None, "plane", 0.01),
            PlacementRule("on", "cup", "desk", 0.05),
            PlacementRule("beside", "keyboard", "monitor", 0.1, 0.6),
            PlacementRule("aligned", "monitor", "desk", float(np.deg2rad(9.0))),
            PlacementRule("upright", "lamp", None, float(np.deg2rad(5.0))),
        ),
        up=(0.0, -1.0, 0.0),
    )


def test_up_may_be_uncertain(tmp_path):
    rules = load_placements(written(tmp_path, "up_sigma_deg = 9\n" + TABLE))
    assert rules.up == (0.0, -1.0, 0.0)
    assert rules.up_sigma == pytest.approx(np.pi / 20)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("up = [0, -2, 0]", "up_sigma_deg = 0", r":2: .*up_sigma_deg"),
        ("up = [0, -2, 0]", "up_sigma_deg = 91", r":2: .*up_sigma_deg"),
        ('on = "plane"', "", r":4: .*needs one of on, beside, aligned_with, upright, has none"),
        ("within_m = 0.6\n", "", r":12: .*within_m goes with beside"),
        ("sigma_deg = 9", "sigma_m = 9", r":18: .*the sigma of aligned_with is sigma_deg"),
        ("sigma_m = 0.01", "sigma_m = 0", r":6: .*greater than or equal to 0.000001"),
        ("upright = true", "uprigth = true", r"uprigth; did you mean upright"),
        ("[0, -2, 0]", "[0, 0, 0]", r":2: .*up must be a direction"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path, old, new, message):
    with pytest.raises(FileError, match=message):
        load_placements(written(tmp_path, TABLE.replace(old, new)))


def test_unknown_classes_are_named():
    rules = (PlacementRule("on", "cup", "plane"), PlacementRule("on", "cup", "desk"))
    check_placement_classes(rules, ["cup", "desk"])
    with pytest.raises(ValueError, match="no class 'desk' in the recording, only: cup"):
        check_placement_classes(rules, ["cup"])
