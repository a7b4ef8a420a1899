"""Colors: none twice, none of a path, the same wherever a map is shown."""

import numpy as np
import pytest

from dqslam._colors import (
    ESTIMATE,
    FIRST,
    ODOMETRY,
    TRUTH,
    _hex,
    _oklab,
    class_colors,
    ink_on,
    object_colors,
)


@pytest.mark.parametrize("count", [1, 7, 9, 20, 80])
def test_no_two_classes_share_a_color(count):
    """And the next ones do not look alike: in OKLab, 0.02 is just noticeable."""
    colors = class_colors([f"class {number:02}" for number in range(count)])
    places = np.array([_oklab(color) for color in [*colors.values(), ODOMETRY, TRUTH, ESTIMATE]])
    apart = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(len(places))
    assert len(colors) == count
    assert apart.min() > {1: 0.1, 7: 0.08, 9: 0.08, 20: 0.06, 80: 0.02}[count]


def test_a_class_has_a_color_by_its_place_among_the_names():
    """How often a class occurs, and what the truth adds, change nothing."""
    once = class_colors(["cup", "book"])
    assert (
        once == class_colors(["cup", "cup", "book", "cup"]) == {"book": FIRST[0], "cup": FIRST[1]}
    )
    assert class_colors(["cup", "book"], ["apple", "cup"]) == once | {"apple": FIRST[2]}
    many = [f"{number:02}" for number in range(30)]
    assert list(class_colors(many[:12]).values()) == list(class_colors(many).values())[:12]


def test_objects_of_one_class_have_colors_of_their_own():
    assert object_colors(["cup", "book", "cup"]) == [FIRST[1], FIRST[0], FIRST[1]]
    assert object_colors(["cup", "cup"]) == [FIRST[0], FIRST[1]]
    assert object_colors([]) == []


def test_oklab():
    """White and pure red, as its author gives them; and back."""
    np.testing.assert_allclose(_oklab("#FFFFFF"), [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(_oklab("#FF0000"), [0.627955, 0.224863, 0.125846], atol=1e-5)
    for color in FIRST:
        assert _hex(_oklab(color)) == color.upper()


def test_ink():
    """The contrast of WCAG of a text on a tab is at least that of large text, 3."""
    assert (ink_on("#FFFFFF"), ink_on("#000000")) == ("black", "white")
    for color in class_colors(map(str, range(60))).values():
        red, green, blue = (
            value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4
            for value in np.array(list(bytes.fromhex(color[1:]))) / 255
        )
        light = 0.2126 * red + 0.7152 * green + 0.0722 * blue
        contrast = {"black": (light + 0.05) / 0.05, "white": 1.05 / (light + 0.05)}
        assert contrast[ink_on(color)] == max(contrast.values()) >= 4.5
