"""The tables of ``dqslam run``: units are shown, and an object has one row in 80 columns."""

import pytest

from dqslam.cli.output import Output
from dqslam.cli.run_tables import _moving, _objects

OBJECT = {
    "id": 12,
    "class_name": "ellipsoid",
    "observations": 105,
    "center_m": [-0.30249, -0.323, 0.119],
    "center_sigma_m": 0.017,
    "semi_axes_m": [0.0551, 0.04812, 0.0381],
    "half_lengths_m": None,
    "shape": "ellipsoid",
    "chi2_median": 0.464,
    "outlier_share": 0.031,
    "doubt": None,
}
TRACK = {
    "id": 3,
    "class_name": "car",
    "behavior": "drives",
    "images": 120,
    "first_s": 1.25,
    "last_s": 9.5,
    "length_of_path_m": 81.24,
    "speed_median_m_s": 9.87,
    "speed_sigma_m_s": 0.213,
    "sides_m": [4.21, 1.72, 1.51],
}


@pytest.fixture
def rows(capsys, monkeypatch):
    """Return a function that gives the lines of a table in a terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")

    def shown(table):
        Output().table(table)
        return [line.split() for line in capsys.readouterr().out.splitlines() if line.strip()]

    return shown


def test_objects(rows):
    heading, _, first, second = rows(_objects([OBJECT, OBJECT | {"center_sigma_m": None}]))
    assert " ".join(heading) == "id class boxes center, m ±, m size, m χ² outliers"
    assert " ".join(first) == "12 ellipsoid 105 -0.30 -0.32 0.12 0.017 0.11x0.096x0.076 0.46 3%"
    assert second[6] == "unknown"


def test_what_moves(rows):
    title, speed, heading, _, row = rows(_moving([TRACK]))
    assert title == ["what", "moves"]
    assert speed == ["speed,"]
    assert " ".join(heading) == "track class does images from, s to, s path, m m/s ± size, m"
    assert " ".join(row) == "3 car drives 120 1.25 9.50 81.2 9.9 0.21 4.2x1.7x1.5"
