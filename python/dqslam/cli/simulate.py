"""``dqslam simulate``: a simulated recording as files, with its truth."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dqslam._files import write_text
from dqslam._outputs import output_set
from dqslam.cli.options import ResultDirectory
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.settings import CONFIG, ConfigFile, save_settings

if TYPE_CHECKING:
    from dqslam.recording import Recording, Truth


def simulate(
    context: typer.Context,
    out: ResultDirectory,
    scenario: Annotated[
        str,
        typer.Argument(
            metavar="NAME|FILE",
            help="paper: a drive on the plane; orbit: hand-held, in space; honest and "
            "honest_orbit: the same, drawn from the assumptions of the estimator; a world of "
            "`dqslam worlds`; or a TOML file like theirs.",
        ),
    ] = "paper",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the world and of all noise.")] = 0,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Write a simulated recording, its truth, and the settings to estimate and evaluate it.

    Writes camera.json, odometry.txt, odometry_covariance.csv and boxes.csv; groundtruth.txt,
    objects.csv and true_boxes.csv; and run.toml and evaluate.toml for --config of these commands.
    """
    from dqslam.config import toml_text
    from dqslam.io.simulated import write_recording, write_truth
    from dqslam.simulation.scenario import load_scenario
    from dqslam.simulation.simulator import simulate

    output = Output(quiet=quiet, as_json=json)
    chosen = load_scenario(scenario)
    whole = output_set(out, "dqslam simulate", inputs=[scenario])
    with whole as folder, output.steps("simulating", 3) as done:
        recording, truth = simulate(chosen, seed=seed)
        done()
        write_recording(recording, folder)
        done()
        write_truth(truth, recording, folder)
        done()
        for name, settings in _commands(out).items():
            write_text(folder / f"{name}.toml", toml_text(settings))
        save_settings(context, folder / CONFIG)
    summary = _summary(recording, truth)
    output.document({"scenario": chosen.name, "seed": seed, "out": str(out), **summary})
    for name, number in summary.items():
        output.line(f"{name}: {number:g}")
    output.line(f"wrote {out}")
    output.line(f"next: dqslam run --config {out / 'run.toml'}")
    output.line(f"then: dqslam evaluate --config {out / 'evaluate.toml'}")


def _commands(out: Path) -> dict[str, dict[str, str]]:
    """Return the options of the commands that estimate and evaluate a recording in a directory."""
    results = str(out / "results")
    run = {
        "command": "run",
        "camera": str(out / "camera.json"),
        "odometry": str(out / "odometry.txt"),
        "odometry_covariance": str(out / "odometry_covariance.csv"),
        "detections": str(out / "boxes.csv"),
        "groundtruth": str(out / "groundtruth.txt"),
        "out": results,
    }
    evaluate = {
        "command": "evaluate",
        "directory": results,
        "groundtruth": str(out / "groundtruth.txt"),
        "objects": str(out / "objects.csv"),
        "match": "id",
        "boxes": str(out / "true_boxes.csv"),
    }
    return {"run": run, "evaluate": evaluate}


def _summary(recording: "Recording", truth: "Truth") -> dict[str, float]:
    import numpy as np

    boxes = recording.detections
    return {
        "poses": len(truth.poses),
        "seconds": float(recording.timestamps[-1] - recording.timestamps[0]),
        "objects": len(truth.centers),
        "objects seen": len(np.unique(boxes.object_id)),
        "boxes": len(boxes),
    }
