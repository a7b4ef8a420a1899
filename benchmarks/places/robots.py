"""Two robots in one world, each with a part of the objects, a start and a drift of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import SeedSequence, default_rng

import dqslam as dq
from dqslam._checks import Floats, Ints
from dqslam.simulation.odometry import measure_odometry
from dqslam.simulation.path import move
from dqslam.simulation.scenario import Scenario

# Three times the paper's objects at its density.
_SIDES = np.sqrt(3.0)
OBJECTS = 30
STARTS = (0.2, 0.8)


@dataclass(frozen=True, eq=False)
class Robot:
    """The map of one robot, and what it should be."""

    graph: dq.Graph
    estimate: dq.Estimate
    marginals: dq.Marginals
    truth: dq.Truth
    """In the robot's own frame, which its first pose is."""


def world(objects: int = OBJECTS, kind: str = "ellipsoids") -> Scenario:
    """Return three times the paper's world."""
    scenario = dq.load_scenario("paper")
    path = scenario.path.model_copy(update={"length_m": 20.0 * _SIDES, "width_m": 12.5 * _SIDES})
    room = scenario.world.model_copy(update={"object_count": objects})
    return scenario.model_copy(update={"path": path, "world": room, "objects": kind})


def drive(scenario: Scenario, start: float, seed: int, number: int, seen: Ints) -> Robot:
    """Map the objects ``seen`` of the world of a seed, from a start on its path."""
    path = scenario.path.model_copy(update={"start_fraction": start})
    scenario = scenario.model_copy(update={"path": path})
    recording, truth = dq.simulate(scenario, seed=seed)
    drift, other = map(default_rng, SeedSequence([seed, number]).spawn(2))
    motion = move(path, other)
    odometry = measure_odometry(motion, scenario.odometry, path.period_s, drift, other)
    detections = recording.detections.select(np.isin(recording.detections.object_id, seen))
    recording = replace(recording, odometry=odometry, detections=detections, positions=None)
    noise = dq.BoxNoise(pixels=scenario.detector.edge_sigma_px, relative=0.0)
    graph = dq.build_graph(recording, box_noise=noise)
    estimate, _ = dq.solve(graph)
    marginals = dq.marginal_covariances(graph, estimate)
    return Robot(graph, estimate, marginals, truth)


def two_robots(
    seed: int, *, shared: float = 0.3, objects: int = OBJECTS, scenario: Scenario | None = None
) -> tuple[Robot, Robot]:
    """Return two robots that both see a share of the objects, and halves of the others."""
    scenario = world(objects) if scenario is None else scenario
    order = default_rng(SeedSequence([seed, 99])).permutation(objects)
    both = round(shared * objects)
    halves = np.array_split(order[both:], 2)
    robots = [
        drive(scenario, start, seed, number, np.concatenate([order[:both], half]))
        for number, (start, half) in enumerate(zip(STARTS, halves, strict=True))
    ]
    return robots[0], robots[1]


def true_motion(a: Robot, b: Robot) -> Floats:
    """Return b_from_a (4, 4) from the places of the objects, which both worlds have in order."""
    p, q = a.truth.centers, b.truth.centers
    moment = (q - q.mean(axis=0)).T @ (p - p.mean(axis=0))
    yaw = np.arctan2(moment[1, 0] - moment[0, 1], moment[0, 0] + moment[1, 1])
    motion = np.eye(4)
    motion[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    motion[:3, 3] = q.mean(axis=0) - motion[:3, :3] @ p.mean(axis=0)
    return motion
