"""A few small recordings and the file of a batch of them."""

from orbit import make_orbit, write_orbit

FLEET = """\
[defaults]
camera = "camera.json"
odometry = "traj.txt"
detections = "boxes.csv"
groundtruth = "traj.txt"

[[recordings]]
folder = "drives/*"
"""


def write_fleet(folder, names, text=FLEET, count=12):
    """Write the same table, seen with other noise, under several names; return the batch's file."""
    for seed, name in enumerate(names):
        place = folder / "drives" / name
        place.mkdir(parents=True)
        write_orbit(place, make_orbit(count, noise_px=0.5, seed=seed))
    path = folder / "fleet.toml"
    path.write_text(text)
    return path
