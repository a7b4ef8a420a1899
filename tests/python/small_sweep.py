"""A small sweep that tests run."""

ROTATION = "scenario.odometry.rotation_sigma_rad"

# A quick drive: half the way, few objects.
SMALL = """\
scenario = "paper"
trials = 3
seed = 5

[fixed]
scenario.path.laps = 1
scenario.world.object_count = 4

[grid]
scenario.odometry.rotation_sigma_rad = [0.01, 0.02]
"estimator.loss" = ["none", "cauchy"]
"""


def sweep_file(folder, text, name="sweep.toml"):
    """Write a sweep's file and return its path."""
    path = folder / name
    path.write_text(text)
    return path
