"""Rules of placement in simulated worlds: what they give, and what wrong ones cost."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
import typer

import dqslam as dq
from dqslam.metrics import true_rows

ONE_TABLE = dq.PlacementRules((dq.PlacementRule("on", None, "plane", 0.005),))
WRONG = {
    "on the ground": dq.PlacementRule("on", "other", "ground", 0.05),
    "on another object": dq.PlacementRule("on", "other", "cube", 0.05),
    "beside another object": dq.PlacementRule("beside", "other", "cube", 0.05, 0.1),
    "aligned with another object": dq.PlacementRule("aligned", "other", "cube", 0.05),
    "upright": dq.PlacementRule("upright", "other", None, 0.05),
}


def errors(estimate: dq.Estimate, truth: dq.Truth) -> tuple[float, float]:
    """Return the mean distances of poses and of centers from their true places, meters."""
    axes = 2 if truth.pose_model == dq.PoseModel.SE2 else 3
    poses = np.linalg.norm(estimate.poses[:, :axes] - truth.poses[:, :axes], axis=1)
    rows = true_rows(estimate.object_ids, truth)
    centers = np.linalg.norm(estimate.centers - truth.centers[rows], axis=1)
    return float(poses.mean()), float(centers.mean())


def measure_table(seeds: range) -> None:
    """Print the errors with and without the plane of a table, for arcs around it."""
    typer.echo(
        "| arc | poses, m | with the plane | centers, m | with the plane | height: error, σ |"
    )
    typer.echo("|---|---|---|---|---|---|")
    orbit = dq.load_scenario("orbit")
    for turns, poses in ((1.5, 150), (0.3, 30), (0.15, 20)):
        scenario = orbit.model_copy(
            update={
                "path": orbit.path.model_copy(update={"turns": turns, "poses": poses}),
                "world": orbit.world.model_copy(update={"lift_max_m": 0.0}),
            }
        )
        without, placed, heights = [], [], []
        for seed in seeds:
            recording, truth = dq.simulate(scenario, seed=seed)
            graph = dq.build_graph(replace(recording, positions=None))
            without.append(errors(dq.solve(graph)[0], truth))
            _, estimate, _, found = dq.solve_with_placements(graph, ONE_TABLE)
            placed.append(errors(estimate, truth))
            heights += [(plane.height, plane.sigma) for plane in found.planes]
        before, after = np.mean(without, axis=0), np.mean(placed, axis=0)
        height, sigma = np.sqrt(np.mean(np.square(heights), axis=0))
        typer.echo(
            f"| {360 * turns:.0f}° | {before[0]:.4f} | {after[0]:.4f} | {before[1]:.4f} "
            f"| {after[1]:.4f} | {height:.4f}, {sigma:.4f} |"
        )


def measure_harm(seeds: range) -> None:
    """Print the errors in the paper's world where rules are wrong for a fifth of the objects."""
    typer.echo("| wrong for 20 % | poses, m | centers, m |")
    typer.echo("|---|---|---|")
    rows: dict[str, list[tuple[float, float]]] = {name: [] for name in ("no rules", *WRONG)}
    for seed in seeds:
        recording, truth = dq.simulate(dq.load_scenario("paper"), seed=seed)
        boxes = recording.detections
        ids = np.unique(boxes.object_id)
        other = np.random.default_rng(seed).choice(ids, len(ids) // 5, replace=False)
        renamed = replace(
            boxes,
            class_id=np.isin(boxes.object_id, other).astype(int),
            class_names={0: "cube", 1: "other"},
        )
        graph = dq.build_graph(replace(recording, detections=renamed, positions=None))
        rows["no rules"].append(errors(dq.solve(graph)[0], truth))
        for name, rule in WRONG.items():
            estimate = dq.solve_with_placements(graph, dq.PlacementRules((rule,)))[1]
            rows[name].append(errors(estimate, truth))
    for name, values in rows.items():
        poses, centers = np.mean(values, axis=0)
        typer.echo(f"| {name} | {poses:.4f} | {centers:.4f} |")


def tabulate(
    trials: Annotated[int, typer.Option(help="Number of seeds.")] = 50,
    seed: Annotated[int, typer.Option(help="The first seed.")] = 0,
) -> None:
    """Measure rules of placement: a table of unknown height, and rules that are wrong."""
    seeds = range(seed, seed + trials)
    measure_table(seeds)
    typer.echo("")
    measure_harm(seeds)
