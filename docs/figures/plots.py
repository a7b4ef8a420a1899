"""Draws plot_*: what ``dqslam plot`` makes of two simulated recordings, one of them with images.

Run by hand after a change: ``./run python docs/figures/plots.py``.
"""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from dqslam import _core, io, load_scenario, simulate
from dqslam.cli import main

HERE = Path(__file__).parent
POSE = 45  # of the picture with outlines
COLORS = ((196, 164, 132), (120, 138, 160), (150, 170, 120), (170, 120, 130))


def estimate(name, seed, folder):
    """Simulate a recording, and run it."""
    main(["simulate", name, "--seed", str(seed), "--out", str(folder), "--quiet"])
    main(["run", "--config", str(folder / "run.toml"), "--quiet"])


def paint_image(truth, camera, pose):
    """Return the true objects as the camera of a pose sees them, far ones first."""
    image = Image.new("RGB", (camera.width, camera.height), (72, 76, 80))
    draw = ImageDraw.Draw(image)
    draw.rectangle([0, 150, camera.width, camera.height], fill=(104, 98, 92))
    seen_from = _core.world_from_camera(truth.pose_model, camera, truth.poses[[pose]])
    here = np.repeat(truth.poses[[pose]], len(truth.ellipsoids), axis=0)
    outlines = _core.project_to_outlines(truth.pose_model, camera, here, truth.ellipsoids)
    distance = np.linalg.norm(truth.centers - seen_from[:, :3], axis=1)
    for row in np.argsort(-distance):
        if np.isnan(outlines[row]).any():
            continue
        color = np.array(COLORS[row % len(COLORS)])
        middle = outlines[row].mean(axis=0)
        for share in np.linspace(1.0, 0.1, 30):  # lighter towards the upper left
            lit = (
                middle
                + share * (outlines[row] - middle)
                - 0.25 * (1.0 - share) * np.ptp(outlines[row], axis=0)
            )
            shade = tuple((color * (0.55 + 0.6 * (1.0 - share))).clip(max=255).astype(int))
            draw.polygon([tuple(point) for point in lit], fill=shade)
    return image


def draw(folder):
    """Draw all figures into a folder, and copy those that the page shows."""
    estimate("paper", 7, folder / "paper")
    main(["plot", str(folder / "paper"), "--kind", "png", "--quiet"])
    estimate("orbit", 1, folder / "orbit")
    recording, truth = simulate(load_scenario("orbit"), seed=1)
    results = io.load_results(folder / "orbit" / "results")
    images = folder / "images"
    images.mkdir()
    image = paint_image(truth, recording.camera, POSE)
    image.save(images / f"{results.timestamps[POSE]:.6f}.png")
    main(["plot", str(folder / "orbit"), "--images", str(images), "--kind", "png", "--quiet"])
    (still,) = (folder / "orbit" / "figures" / "images").iterdir()
    keep(still, "images")
    for source, name in (
        ("paper", "map"),
        ("paper", "position_error"),
        ("paper", "residuals"),
        ("orbit", "boxes"),
    ):
        keep(folder / source / "figures" / f"{name}.png", name)


def keep(figure, name):
    """Put a figure beside this file, with few colors."""
    image = Image.open(figure).convert("RGB").quantize(128, dither=Image.Dither.NONE)
    image.save(HERE / f"plot_{name}.png", optimize=True)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        draw(Path(temporary))
