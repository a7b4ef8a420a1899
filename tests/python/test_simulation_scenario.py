from pathlib import Path

import pytest

from dqslam.simulation.scenario import load_scenario
from dqslam.studies.worlds import all_worlds

PAPER = Path(__file__).parents[2] / "data" / "scenarios" / "paper.toml"


def written(tmp_path, old, new):
    text = PAPER.read_text()
    assert old in text
    path = tmp_path / "changed.toml"
    path.write_text(text.replace(old, new))
    return path


def test_the_papers_values():
    scenario = load_scenario("paper")
    assert scenario.objects == "cubes"
    assert (scenario.path.laps, scenario.world.object_count) == (2, 10)
    assert (scenario.camera.focal_length_mm, scenario.camera.pixel_size_um) == (15.0, 10.0)
    assert (scenario.camera.width_px, scenario.camera.height_px) == (1280, 1024)
    assert scenario.camera.heading_deg == 90.0
    assert scenario.world.height_sigma_m == 0.3
    sides = (scenario.world.side_mean_m, scenario.world.side_sigma_m, scenario.world.side_min_m)
    assert sides == (0.5, 0.3, 0.2)
    assert (scenario.detector.min_side_px, scenario.detector.edge_sigma_px) == (100.0, 1.0)
    odometry = scenario.odometry
    assert (odometry.translation_sigma_m, odometry.rotation_sigma_rad) == (0.02, 0.02)
    assert odometry.turn_rotation_sigma_rad == 0.1
    assert scenario.relative_position.sigma_m == 0.1


def test_a_name_and_its_path_are_the_same():
    assert load_scenario("paper") == load_scenario(PAPER) == load_scenario(str(PAPER))


def test_a_file_may_only_have_what_differs(tmp_path):
    path = tmp_path / "near.toml"
    path.write_text('base = "paper"\nobjects = "ellipsoids"\n[world]\nmargin_m = 3.0\n')
    near, paper = load_scenario(path), load_scenario("paper")
    assert (near.name, near.objects, near.world.margin_m) == ("near", "ellipsoids", 3.0)
    world = paper.world.model_copy(update={"margin_m": 3.0})
    changes = {"name": "near", "objects": "ellipsoids", "world": world}
    assert near == paper.model_copy(update=changes)


def test_what_comes_with_dqslam_is_whole():
    for path in sorted(PAPER.parent.glob("*.toml")):
        assert load_scenario(path.stem).name == path.stem
    assert load_scenario("honest_orbit").path == load_scenario("orbit").path


@pytest.mark.parametrize(
    ("base", "error", "message"),
    [
        ('"moon"', FileNotFoundError, "moon: no such scenario"),
        ('"honest"', ValueError, "far.toml:1: base: honest is not whole, but has a base"),
        ("3", ValueError, "far.toml:1: base: expected the name of a scenario, not 3"),
    ],
)
def test_a_base_is_a_whole_scenario(tmp_path, base, error, message):
    path = tmp_path / "far.toml"
    path.write_text(f"base = {base}\n")
    with pytest.raises(error, match=message):
        load_scenario(path)


def test_objects_can_be_chosen(tmp_path):
    path = written(tmp_path, 'objects = "cubes"', 'objects = "ellipsoids"')
    assert load_scenario(path).objects == "ellipsoids"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('objects = "cubes"', 'objects = "spheres"', r"objects: Input should be 'cubes', 'ell"),
        ("laps = 2", "laps = 0", r"path\.laps: .* greater than or equal to 1"),
        ("laps = 2", "laps = 2.5", r"path\.laps: .* integer"),
        ("laps = 2", "", r":7: path\.laps is missing$"),
        ("laps = 2", "laps = 2\nlap = 2", r":13: unknown key path\.lap; did you mean laps\?$"),
        ("step_m = 0.5", "step_m = nan", r"path\.step_m: .* finite"),
        ("step_m = 0.5", "step_m = inf", r"path\.step_m: .* finite"),
        ("start_fraction = 0.5", "start_fraction = 1.5", r"path\.start_fraction: .* less than"),
        ("sigma_m = 0.1   ", "sigma_m = -0.1   ", r"relative_position\.sigma_m: .* greater than 0"),
        ("[0.8, 1.4]", "[1.4, 0.8]", r"world: .*semi_axis_factor: the first number is above"),
        ('kind = "inside_path"', 'kind = "on_moon"', r"world: Input tag 'on_moon' .*'on_table'"),
        ('kind = "rounded_rectangle"', "", r"path: Unable to extract tag using discriminator"),
        ("[world]", "[wrld]", r"world is missing\n.*:25: unknown key wrld; did you mean world\?$"),
        ("[path]", "[path", r":7: not a TOML file: Expected ']'"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path, old, new, message):
    path = written(tmp_path, old, new)
    with pytest.raises(ValueError, match=message) as error:
        load_scenario(path)
    for line in str(error.value).splitlines():
        assert line.startswith(f"{path}:")


@pytest.mark.parametrize("name", ["papers", "no/such/file.toml", "paper.toml"])
def test_a_missing_scenario_lists_those_there_are(name):
    with pytest.raises(FileNotFoundError, match=rf"{name}: no such scenario.*: .*\bpaper\b"):
        load_scenario(name)


def test_odometry_is_of_the_paths_kind(tmp_path):
    orbit = (PAPER.parent / "orbit.toml").read_text()
    path = tmp_path / "mixed.toml"
    paper_odometry = PAPER.read_text().partition("[odometry]")[2].partition("[")[0]
    before, _, after = orbit.partition("[odometry]")
    path.write_text(before + "[odometry]" + paper_odometry + "[" + after.partition("[")[2])
    with pytest.raises(ValueError, match=r"odometry\.kind: expected 'spatial' with path.kind 'orb"):
        load_scenario(path)


# --- the battery of worlds -----------------------------------------------------------------------


def test_a_section_of_another_kind_replaces_the_bases(tmp_path):
    path = tmp_path / "near.toml"
    path.write_text(
        'base = "paper"\n[path]\nkind = "straight"\nlength_m = 9.0\nstep_m = 0.5\nperiod_s = 1.0\n'
    )
    near = load_scenario(path)
    assert near.path.model_dump() == {
        "kind": "straight",
        "length_m": 9.0,
        "step_m": 0.5,
        "period_s": 1.0,
    }
    assert near.odometry == load_scenario("paper").odometry
    path.write_text('base = "paper"\n[path]\nkind = "straight"\nlength_m = 9.0\n')
    with pytest.raises(ValueError, match=r"path\.step_m is missing\n.*path\.period_s is missing"):
        load_scenario(path)


def test_each_world_of_the_battery_is_a_scenario_with_a_title():
    names = {path.stem for path in (PAPER.parent / "worlds").glob("*.toml")}
    assert names == set(all_worlds())
    assert len(all_worlds()) == len(names)
    titles = {load_scenario(name).title for name in names}
    assert len(titles) == len(names)
    assert "" not in titles


def test_a_world_of_the_battery_differs_from_its_base_where_it_says():
    loop = load_scenario("loop")
    assert loop.model_copy(update={"title": "", "name": "paper", "objects": "cubes"}) == (
        load_scenario("paper")
    )
    for name, section in [("odometry_x4", "odometry"), ("occlusion", "detector"), ("focal_2", "")]:
        world = load_scenario(name)
        assert world.path == loop.path
        assert (world.odometry != loop.odometry) == (section == "odometry")
        assert (world.detector != loop.detector) == (section == "detector")
        assert (world.calibration != loop.calibration) == (section == "")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("laps = 2", "laps = 1_000_000_000", r"laps: .*less than or equal to 1000000"),
        ("step_m = 0.5 ", "step_m = 1e-12 ", "the path has .* steps, more than 10000000"),
        ("object_count = 10", "object_count = 1e12", "object_count: .*less than or equal to 10000"),
    ],
)
def test_numbers_that_would_fill_the_memory(tmp_path, old, new, message):
    with pytest.raises(ValueError, match=message):
        load_scenario(str(written(tmp_path, old, new)))
