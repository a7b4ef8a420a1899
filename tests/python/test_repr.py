"""What a prompt shows of recordings, options and answers: one line, what and how many."""

import pytest

import dqslam as dq


@pytest.fixture(scope="module")
def made():
    recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    graph = dq.build_graph(recording)
    estimate, _ = dq.solve(graph, dq.SolveOptions(max_iterations=1))
    return {"recording": recording, "truth": truth, "graph": graph, "estimate": estimate}


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("recording", "Recording(SE2, 253 poses, 456 boxes of 10 objects, 1 class, 456 positions)"),
        ("truth", "Truth(SE2, 253 poses, 10 objects)"),
        ("graph", "Graph(SE2, 253 poses, 456 boxes of 10 objects)"),
        ("estimate", "Estimate(SE2, 253 poses, 10 objects)"),
    ],
)
def test_what_there_is_in_a_line(made, name, text):
    assert repr(made[name]) == text


def test_options_show_what_is_not_the_default():
    assert repr(dq.SolveOptions()) == "SolveOptions()"
    options = dq.SolveOptions(loss=dq.Loss.CAUCHY, max_iterations=20, function_tolerance=1e-9)
    assert repr(options) == "SolveOptions(loss=CAUCHY, max_iterations=20, function_tolerance=1e-09)"
    priors = dq.ScenePriors(up=[0.0, 0.6, 0.8], camera_height=0.5)
    assert repr(priors) == "ScenePriors(up=[0.  0.6 0.8], camera_height=0.5)"
    assert repr(dq.OnlineOptions(window_poses=5)) == "OnlineOptions(window_poses=5)"


def test_a_camera_shows_its_numbers(made):
    camera = dq.Camera(525.5, 525, 319.5, 239.5, 640, 480)
    assert repr(camera) == "Camera(640 x 480 px, fx=525.5, fy=525, cx=319.5, cy=239.5)"
    lens = dq.Camera(525, 525, 319.5, 239.5, 640, 480, distortion=[0.1, 0, 0, 0, 0])
    assert repr(lens) == "Camera(640 x 480 px, fx=525, fy=525, cx=319.5, cy=239.5, distorted)"


def test_a_step_report_shows_what_was_done(made):
    slam = dq.OnlineSlam(made["recording"].camera)
    for step in dq.steps_of(made["recording"]):
        report = slam.add(step.odometry, step.boxes)
    assert repr(report).startswith("StepReport(pose=252, first_observation=")
    assert f"window_poses=10, window_objects={report.window_objects}, " in repr(report)
    assert f"chi_square={report.chi_square:g})" in repr(report)
    assert repr(slam) == "OnlineSlam(SE2, 253 steps, 10 objects)"


def test_how_a_solve_went_in_a_line(made):
    _, summary = dq.solve(made["graph"], dq.SolveOptions(max_iterations=1))
    assert repr(summary) == f"Summary({summary})"
    assert "\n" not in repr(summary)


def test_covariances_in_a_line(made):
    marginals = dq.marginal_covariances(made["graph"], made["estimate"])
    assert repr(marginals) == "Marginals(253 poses, 10 objects)"
