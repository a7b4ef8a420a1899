import numpy as np
import pytest

from dqslam.assumptions.traffic import SWELLING, usual_size


def test_a_car_by_hand():
    """Half of 4.3 by 1.8 by 1.5 m, larger by (4 / pi)^(2/3) as the mean of three logarithms."""
    size = 0.5 * (4.3 * 1.8 * 1.5) ** (1 / 3) * (4 / np.pi) ** (2 / 3)
    assert np.exp(usual_size("car")) == pytest.approx(size)


def test_names_in_any_case_and_nothing_else():
    assert usual_size("Car") == usual_size("CAR") == usual_size("car")
    assert usual_size("Pedestrian") == usual_size("person")
    assert usual_size("cup") is None
    assert usual_size("") is None


def test_larger_things_are_larger():
    sizes = [
        usual_size(name) for name in ("person", "bicycle", "car", "van", "truck", "bus", "tram")
    ]
    assert sizes == sorted(sizes)
    assert None not in sizes


def test_an_ellipse_around_a_rectangle_is_larger_by_the_swelling():
    """Widths of a rectangle and of the ellipse inscribed in it, over all directions seen from."""
    direction = np.linspace(0.0, np.pi, 100001)[:-1]
    length, width = 4.3, 1.8
    rectangle = length * np.abs(np.cos(direction)) + width * np.abs(np.sin(direction))
    square = 2 * width * (np.abs(np.cos(direction)) + np.abs(np.sin(direction))) / 2
    assert square.mean() / width == pytest.approx(4 / np.pi, rel=1e-6)
    ellipse = np.hypot(length * np.cos(direction), width * np.sin(direction))
    assert 1.05 < (rectangle / ellipse).mean() < 4 / np.pi
    assert pytest.approx((4 / np.pi) ** (2 / 3)) == SWELLING
