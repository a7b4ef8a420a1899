"""What is passed in the wrong place is named, with what is wanted there."""

import numpy as np
import pytest

import dqslam as dq


@pytest.fixture(scope="module")
def made():
    recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    graph = dq.build_graph(recording)
    estimate, _ = dq.solve(graph, dq.SolveOptions(max_iterations=1))
    return {"recording": recording, "truth": truth, "graph": graph, "estimate": estimate}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda recording, **_: dq.solve(recording),
            r"solve needs a Graph, not a Recording: call build_graph\(recording\) first",
        ),
        (
            lambda graph, truth, **_: dq.solve(graph, truth),
            r"solve needs a SolveOptions, not a Truth: SolveOptions\(loss=Loss.CAUCHY\)",
        ),
        (
            lambda graph, **_: dq.build_graph(graph),
            "build_graph needs a Recording, not a Graph: "
            r"recording, truth = simulate\(scenario, seed=0\)",
        ),
        (
            lambda recording, truth, **_: dq.build_graph((recording, truth)),
            "build_graph needs a Recording, not a tuple",
        ),
        (
            lambda recording, truth, **_: dq.evaluate(recording, truth),
            r"evaluate needs an Estimate, not a Recording: estimate, summary = solve\(graph\)",
        ),
        (
            lambda estimate, recording, **_: dq.evaluate(estimate, recording),
            "evaluate needs a Truth, not a Recording",
        ),
        (
            lambda graph, **_: dq.associate(graph),
            "associate needs a Recording, not a Graph",
        ),
        (
            lambda estimate, **_: dq.save_estimate("somewhere", estimate),
            r"save_estimate needs an Estimate, not a str: save_estimate\(estimate, directory\)",
        ),
        (
            lambda estimate, graph, **_: dq.marginal_covariances(estimate, graph),
            r"marginal_covariances needs a Graph, not an Estimate",
        ),
        (
            lambda graph, recording, **_: dq.marginal_covariances(graph, recording),
            "marginal_covariances needs an Estimate, not a Recording",
        ),
        (
            lambda recording, truth, **_: dq.posterior_bound(recording, truth),
            "posterior_bound needs a Graph, not a Recording",
        ),
        (
            lambda graph, recording, **_: dq.posterior_bound(graph, recording),
            "posterior_bound needs a Truth, not a Recording",
        ),
        (
            lambda recording, **_: dq.OnlineSlam(recording),
            r"OnlineSlam needs a Camera, not a Recording: OnlineSlam\(recording.camera\)",
        ),
        (
            lambda recording, **_: dq.OnlineSlam(recording.camera).add(dq.Step(0.0, None)),
            r"OnlineSlam.add needs a Motion, not a Step: slam.add\(step.odometry, step.boxes",
        ),
        (
            lambda recording, **_: dq.OnlineSlam(recording.camera).add(None, [[0, 0, 9, 9]]),
            "OnlineSlam.add needs a StepBoxes, not a list",
        ),
        (
            lambda recording, **_: dq.OnlineSlam(recording.camera).add(None, positions=np.eye(3)),
            "OnlineSlam.add needs a StepPositions, not an? ndarray",
        ),
        (
            lambda **_: dq.simulate("paper", seed=0),
            r"simulate needs a Scenario, not a str: load_scenario\(\"paper\"\)",
        ),
    ],
)
def test_a_wrong_type_gets_a_sentence(made, call, message):
    with pytest.raises(TypeError, match=f"^{message}"):
        call(**made)
