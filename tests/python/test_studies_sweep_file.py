"""Files of sweeps into cells."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from dqslam import _core, load_scenario
from dqslam.io.files import FileError
from dqslam.studies.sweep import load_sweep
from dqslam.studies.sweep import trial as trial_module
from small_sweep import ROTATION, SMALL, sweep_file

PAPER = load_scenario("paper")
EDGE = "scenario.detector.edge_sigma_px"


@pytest.fixture
def write(tmp_path):
    return partial(sweep_file, tmp_path)


def test_cells_are_the_grid_with_its_last_setting_fastest(write):
    sweep = load_sweep(write(SMALL))
    assert sweep.parameters == (ROTATION, "estimator.loss")
    assert [tuple(cell.values.values()) for cell in sweep.cells] == [
        (0.01, "none"),
        (0.01, "cauchy"),
        (0.02, "none"),
        (0.02, "cauchy"),
    ]
    assert sweep.seeds == (5, 6, 7)
    for cell in sweep.cells:
        scenario = cell.settings.scenario
        assert (scenario.path.laps, scenario.world.object_count) == (1, 4)
        assert scenario.odometry.rotation_sigma_rad == cell.values[ROTATION]
        loss = cell.values["estimator.loss"]
        assert cell.settings.options().loss == _core.Loss[loss.upper()]
        assert scenario.camera == PAPER.camera


def test_a_file_without_varied_settings_is_one_cell_of_50_seeds(write):
    sweep = load_sweep(write('scenario = "honest"\n'))
    assert sweep.parameters == ()
    assert [cell.settings.scenario.name for cell in sweep.cells] == ["honest"]
    assert sweep.seeds == tuple(range(50))


def test_a_scenario_beside_the_file_is_found(write):
    write('base = "paper"\nobjects = "ellipsoids"\n', "mine.toml")
    sweep = load_sweep(write('scenario = "mine.toml"\n'))
    assert sweep.cells[0].settings.scenario.objects == "ellipsoids"


RANDOM = """\
scenario = "paper"
samples = {samples}

[grid]
estimator.loss = ["none", "dcs"]

[random]
scenario.detector.edge_sigma_px = {{ low = 0.5, high = 8.0, log = true }}
scenario.odometry.rotation_sigma_rad = {{ low = 0.01, high = 0.03 }}
scenario.world.object_count = {{ low = 5, high = 8, whole = true }}
"""


def test_random_settings_are_spread_as_told_and_crossed_with_the_grid(write):
    sweep = load_sweep(write(RANDOM.format(samples=400)))
    assert len(sweep.cells) == 800
    edge, rotation, count = (
        np.array([cell.values[name] for cell in sweep.cells])
        for name in (EDGE, ROTATION, "scenario.world.object_count")
    )
    for values in (edge, rotation, count):  # both losses see the same samples
        np.testing.assert_array_equal(values[:400], values[400:])
    assert 0.5 <= edge.min() < 0.52
    assert 7.6 < edge.max() < 8.0
    assert np.median(edge) == pytest.approx(2.0, rel=0.15)  # the geometric mean of both ends
    assert np.mean(rotation) == pytest.approx(0.02, rel=0.05)
    assert set(count.tolist()) == {5, 6, 7, 8}
    assert np.abs(np.corrcoef([np.log(edge), rotation, count])[np.triu_indices(3, 1)]).max() < 0.15


def test_more_samples_add_to_those_there_were(write):
    few = load_sweep(write(RANDOM.format(samples=3)))
    many = load_sweep(write(RANDOM.format(samples=10)))
    assert [cell.values for cell in few.cells[:3]] == [cell.values for cell in many.cells[:3]]
    other = load_sweep(write("sample_seed = 1\n" + RANDOM.format(samples=3)))
    assert other.cells[0].values[EDGE] != few.cells[0].values[EDGE]


def test_all_mistakes_are_named_at_once_with_their_lines(write):
    path = write(
        """\
scenario = "paper"
samples = 2
[fixed]
scenario.objects = "spheres"
scenario.detector.min_side_px = 9.0
[grid]
scenario.odometry.rotation_sigma = [0.01, 0.02]
"estimator.loss" = ["none",
   "cauchi"]
estimator.max_iterations = 3
scenario.detector.min_side_px = [50.0, -1.0, 50.0]
[random]
scenario.detector.edge_sigma_px = { low = 0.5, hig = 8.0 }
scenario.world.object_count = { low = 10, high = 5, whole = true }
scenario.odometry.translation_sigma_m = 3
"""
    )
    with pytest.raises(FileError) as caught:
        load_sweep(path)
    said = str(caught.value).replace(f"{path}:", "").splitlines()
    for mistake in (
        "4: scenario.objects: Input should be 'cubes', 'ellipsoids' or 'cuboids', not 'spheres'",
        "7: unknown key scenario.odometry.rotation_sigma; did you mean rotation_sigma_rad?",
        "10: estimator.max_iterations: expected values, like [1, 2]",
        "11: scenario.detector.min_side_px: 50.0 occurs twice",
        "11: scenario.detector.min_side_px: Input should be greater than or equal to 0, not -1.0",
        "13: scenario.detector.edge_sigma_px.high is missing",
        "13: unknown key scenario.detector.edge_sigma_px.hig; did you mean high?",
        "14: scenario.world.object_count: low, 10, is not below high, 5",
        "15: scenario.odometry.translation_sigma_m: expected a range, "
        "like { low = 1.0, high = 2.0 }",
        "11: scenario.detector.min_side_px is in another table too",
    ):
        assert mistake in said
    assert any(line.startswith("9: estimator.loss: Input should be 'none', ") for line in said)
    assert len(said) == len(set(said))


WRONG_IN_ALL_PARTS = """\
scenario = {scenario}
trails = 3
bound = 3
[fixed]
estimator.los = "none"
scenario.object = "cubes"
[grid]
estimator.max_iteration = 3
estimator.loss = ["cauchi"]
[random]
estimator.tolerance = {{ low = 1.0 }}
"""


@pytest.mark.parametrize(
    ("scenario", "of_scenario"),
    [
        ('"paper"', "6: unknown key scenario.object; did you mean objects?"),
        ('"moon"', "1: scenario: moon: no such scenario; by name there are: honest"),
        ('"mine.toml"', "mine.toml:1: unknown key camra; did you mean camera?"),
        ('"empty.toml"', "empty.toml: is empty"),
        ("3", "1: scenario: Input should be a valid string, not 3"),
    ],
)
def test_what_is_wrong_in_one_part_hides_nothing_in_another(write, scenario, of_scenario):
    """Misspelt keys with a value of the wrong kind too; settings of no scenario are not judged."""
    write("camra = 1\nbase = 'paper'\n", "mine.toml")
    write("", "empty.toml")
    path = write(WRONG_IN_ALL_PARTS.format(scenario=scenario))
    with pytest.raises(FileError) as caught:
        load_sweep(path)
    said = sorted(str(caught.value).replace(f"{path}:", "").splitlines())
    expected = [
        "11: estimator.tolerance.high is missing",
        "11: unknown key estimator.tolerance; did you mean grow_tolerance?",
        "2: unknown key trails; did you mean trials?",
        "3: bound: Input should be a valid boolean",
        "5: unknown key estimator.los; did you mean loss?",
        "8: estimator.max_iteration: expected values, like [1, 2]",
        "8: unknown key estimator.max_iteration; did you mean max_iterations?",
        "9: estimator.loss: Input should be 'none', 'huber'",
    ]
    (other,) = [line for line in said if not line.startswith(tuple(expected))]
    assert of_scenario in other
    assert len(said) == len(expected) + 1
    for start in expected:
        assert any(line.startswith(start) for line in said)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('scenario = "moon"', "1: scenario: moon: no such scenario; by name there are: honest"),
        ("trials = 3", "scenario is missing"),
        ('scenario = "paper"\ntrials = 0', "2: trials: Input should be greater than"),
        ('scenario = "paper"\ntrails = 9', "2: unknown key trails; did you mean trials?"),
        ('scenario = "paper"\nsamples = 9', "2: samples: no setting is random"),
        ('scenario = "paper"\ngrid.estimator.method = ["paper"]', "algebraic_sigma is missing"),
        (
            'scenario = "paper"\nbound = true\nfixed.estimator.method = "paper"',
            "method: the paper's has neither",
        ),
        ('scenario = "paper"\nrandom.x = { low = 0, high = 1, log = true }', "low is not above 0"),
        ('scenario = "paper"\nrandom.x = { low = 0.5, high = 1, whole = true }', "whole low and"),
        ('scenario = "paper"\n[grid', "2: not a TOML file"),
    ],
)
def test_a_wrong_file_is_refused(write, text, message):
    path = write(text)
    with pytest.raises(FileError) as caught:
        load_sweep(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(path))


PAGE = (Path(__file__).parents[2] / "docs" / "sweeps.md").read_text(encoding="utf-8")


def test_the_page_shows_a_file_that_is_right_and_has_all_metrics(write):
    (text,) = re.findall(r"^```toml\n(.*?)^```$", PAGE, flags=re.MULTILINE | re.DOTALL)
    sweep = load_sweep(write("samples = 10\n" + text))
    assert len(sweep.cells) * len(sweep.seeds) == 3000
    for name in trial_module.METRICS:
        assert f"`{name}`" in PAGE


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "trials = 1_000_000_000_000",
            r":2: trials: Input should be less than or equal to 1000000",
        ),
        ("trials = 1e12", r":2: trials: Input should be less than or equal to 1000000"),
        ("samples = 10_000_000\n[random]\nx = { low = 0.0, high = 1.0 }", r":2: samples: Input"),
        (
            "samples = 1_000_000\n[grid]\nestimator.loss = ['none', 'dcs']\n"
            "[random]\nscenario.odometry.rotation_sigma_rad = { low = 0.01, high = 0.03 }",
            "it has 2000000 cells, more than 1000000",
        ),
    ],
)
def test_numbers_that_would_fill_the_memory(write, text, message):
    with pytest.raises(FileError, match=message):
        load_sweep(write(f'scenario = "paper"\n{text}\n'))
