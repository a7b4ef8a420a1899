"""The paper's experiment, run while the site is built: its table and its figure.

Writes ``_generated/paper_table.txt``, which the page on the experiment includes. How many seeds:
``dqslam_paper_trials``; the processes are those of the machine.
"""

import os
from pathlib import Path

from sphinx.application import Sphinx

ROW_TITLES = {"monocular": "monocular", "relative_position": "with relative position"}
METRICS = ("rmse_pos", "rmse_landmark", "rmse_volume")
FIGURE = "paper_maps.png"
EXAMPLES = 6  # maps drawn, as in the paper's figure


def write_table(folder: Path, trials: int) -> None:
    """Run the experiment and write table and figure into a folder."""
    import dqslam as dq
    from dqslam.studies.paper import PAPER_ODOMETRY, PAPER_ROWS, example_maps

    table = dq.run_paper(
        dq.load_scenario("paper"),
        trials=trials,
        seed=0,
        method="dqslam",
        jobs=os.cpu_count() or 1,
    )
    dq.plot_maps(example_maps(table, min(EXAMPLES, trials)), folder / FIGURE)
    lines = [
        "| mean / median | positions, m | centers, m | volumes, m³ |",
        "|---|---|---|---|",
        f"| odometry, printed | {_pair(PAPER_ODOMETRY)} | | |",
        f"| odometry, this build | {_pair((table.odometry.avg, table.odometry.med))} | | |",
    ]
    for name, title in ROW_TITLES.items():
        metrics = table.best(name).metrics
        printed = [_pair(PAPER_ROWS[name][metric]) for metric in METRICS]
        ours = [f"**{_pair((metrics[one].avg, metrics[one].med))}**" for one in METRICS]
        lines.append(f"| {title}, printed | {' | '.join(printed)} |")
        lines.append(f"| **{title}, this build** | {' | '.join(ours)} |")
    failed = sum(len(table.best(name).failures) for name in ROW_TITLES)
    lines += [
        "",
        f"Seeds 0 to {trials - 1}, {failed} trials failed.",
        "",
        f"![Simulated drives from above: odometry, truth and estimate](_generated/{FIGURE})",
    ]
    (folder / "paper_table.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _pair(values: tuple[float, float]) -> str:
    return " / ".join(f"{value:.2f}" for value in values)


def _run(app: Sphinx) -> None:
    folder = Path(app.srcdir) / "_generated"
    folder.mkdir(exist_ok=True)
    write_table(folder, app.config.dqslam_paper_trials)


def setup(app: Sphinx) -> dict[str, bool]:
    """Run the experiment before the sources are read."""
    app.add_config_value("dqslam_paper_trials", 50, "env", [int])
    app.connect("builder-inited", _run, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
