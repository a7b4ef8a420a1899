"""``dqslam run``: a map and a trajectory from the files of a recording."""

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from dqslam._files import refuse_inputs
from dqslam._input import refuse_shared_input
from dqslam._outputs import check_output_set
from dqslam.cli.groups import with_groups
from dqslam.cli.options import ResultDirectory
from dqslam.cli.output import Json, Output, Quiet
from dqslam.cli.reading import RecordingOptions
from dqslam.cli.run_tables import show_report
from dqslam.cli.settings import CONFIG, ConfigFile, settings_text

if TYPE_CHECKING:
    from dqslam._core import Shape
    from dqslam.assumptions import ClassShapes, OdometryNoise
    from dqslam.online import OnlineSlam, Step
    from dqslam.view.session import SessionRecorder

DOUBTFUL = 3  # exit code of a run whose result is doubtful
NOISE = "translation=0.02, rotation=0.01"


@with_groups
def run(
    context: typer.Context,
    files: RecordingOptions,
    out: ResultDirectory,
    min_score: Annotated[
        float, typer.Option(help="Leave out boxes with a lower score, 0 to 1.")
    ] = 0.5,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Refuse files with any bad box or pose, as --max-bad 0 does, and files of which "
            "the checks of inspect warn.",
        ),
    ] = False,
    ids: Annotated[
        Literal["none", "track_id", "class_id"],
        typer.Option(
            metavar="SOURCE",
            help="Where the ids of objects come from: none, track_id of a tracker, or class_id if "
            "each class has one object.",
        ),
    ] = "track_id",
    trust_ids: Annotated[
        float,
        typer.Option(
            min=0.5,
            max=1.0,
            help="Probability that an id stays with its object. With 1, ids are final. With less, "
            "boxes without ids are used too, and ids are split and joined.",
        ),
    ] = 1.0,
    mode: Annotated[
        Literal["slam", "mapping"],
        typer.Option(help="slam estimates the path too; mapping keeps the odometry."),
    ] = "slam",
    estimate: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Parameters of the calibration to estimate, too, with commas between: mount, "
            "mount_position, focal, principal_point, k1, odometry_scale, gyro_bias, time_offset.",
        ),
    ] = None,
    perturb_odometry: Annotated[
        str | None,
        typer.Option(
            metavar="NOISE", help=f'Add noise of this sigma to every step, m and rad: "{NOISE}".'
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of that noise, and of the choice of boxes to hold out.")
    ] = 0,
    odometry_noise: Annotated[
        str | None,
        typer.Option(
            metavar="NOISE",
            help="Sigma to assume for every step, in the same form. Default: the noise that was "
            "added, or else a level that is estimated from the boxes.",
        ),
    ] = None,
    odometry_covariance: Annotated[
        Path | None,
        typer.Option(
            help="CSV of the covariance of each step, m and rad squared, instead of one sigma.",
            rich_help_panel="More measurements",
        ),
    ] = None,
    positions: Annotated[
        Path | None,
        typer.Option(
            help="CSV of measured centers of objects in the camera frame, with final ids.",
            rich_help_panel="More measurements",
        ),
    ] = None,
    absolute: Annotated[
        Path | None,
        typer.Option(
            help="CSV of positions of the camera in a frame of their own, like GPS.",
            rich_help_panel="More measurements",
        ),
    ] = None,
    closures: Annotated[
        Path | None,
        typer.Option(
            help="CSV of relative poses of the camera: loop closures.",
            rich_help_panel="More measurements",
        ),
    ] = None,
    groundtruth: Annotated[
        Path | None, typer.Option(help="TUM trajectory to compare with, in any world frame.")
    ] = None,
    size_priors: Annotated[
        Path | None,
        typer.Option(
            help="TOML table of sizes by class. Default: one size for all, from the recording."
        ),
    ] = None,
    shapes: Annotated[
        str,
        typer.Option(
            metavar="SHAPES",
            help="Shape of objects: ellipsoid, cuboid, cylinder, auto, which is what boxes that "
            "took no part show, or a TOML file with the shape of each class.",
        ),
    ] = "ellipsoid",
    placements: Annotated[
        Path | None,
        typer.Option(
            help="TOML table of where objects of a class are: on a plane or on another object, "
            "beside or aligned with one, upright."
        ),
    ] = None,
    hold_out: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=0.99,
            help="Share of boxes that the estimator does not use, to test the map.",
        ),
    ] = 0.0,
    threads: Annotated[
        int,
        typer.Option(min=1, help="Threads of the solver. The result is the same with any number."),
    ] = 1,
    online: Annotated[
        bool,
        typer.Option("--online", help="Replay the recording step by step, and polish at the end."),
    ] = False,
    mcap: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.mcap",
            help="Also write the result as MCAP, for Foxglove; with --online, step by step while "
            "it runs.",
        ),
    ] = None,
    foxglove: Annotated[
        bool,
        typer.Option(
            "--foxglove",
            help="With --online, show each step over a websocket, for Foxglove or Lichtblick, in "
            "the time that the recording took.",
        ),
    ] = False,
    host: Annotated[
        str, typer.Option(help="Address of the websocket; 0.0.0.0 lets other machines connect.")
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=1, max=65535, help="Port of the websocket of --foxglove.")
    ] = 8765,
    force: Annotated[
        bool,
        typer.Option("--force", help="Go on if poses and boxes do not fit together."),
    ] = False,
    config: ConfigFile = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Estimate the trajectory and the objects of a recording.

    Writes trajectory.txt, odometry.txt (the initial poses), map.json, boxes.csv, camera.json,
    report.json and config.toml. Exits with 3 if the result is doubtful: poses and boxes do not fit
    together, the map is empty, or most boxes show nothing in it.
    """
    from dqslam import _core, io
    from dqslam.assumptions import load_placements, load_size_priors
    from dqslam.pipeline import RunFilesOptions, run_files
    from dqslam.pipeline.files import WRITTEN_BY
    from dqslam.view import build_scene, record_session, serve_session, write_mcap

    inputs = (
        *(*files.files, groundtruth, size_priors, odometry_covariance),
        *(positions, absolute, closures),
    )
    refuse_shared_input(*inputs)
    check_output_set(out, WRITTEN_BY, inputs=inputs)
    added = parse_noise("--perturb-odometry", perturb_odometry)
    believed = parse_noise("--odometry-noise", odometry_noise)
    if odometry_covariance is not None and (added or believed):
        raise ValueError("--odometry-covariance: another option gives the noise already")
    if online and mode == "mapping":
        raise ValueError("--online: cannot be combined with --mode mapping")
    reading = files.read_options()
    options = RunFilesOptions(
        ids=ids,
        trust_ids=trust_ids,
        mode=_core.Mode[mode.upper()],
        size_prior=None if size_priors is None else load_size_priors(size_priors),
        shapes=parse_shapes(shapes),
        placements=None if placements is None else load_placements(placements),
        estimate=split_names(estimate),
        hold_out=hold_out,
        seed=seed,
        threads=threads,
        min_score=min_score,
        extras=io.Extras(positions=positions, absolute=absolute, closures=closures),
        reading=replace(reading, max_bad=0.0) if strict else reading,
        force=force,
        strict=strict,
        added_noise=added,
        odometry_noise=believed,
        odometry_covariance=odometry_covariance,
    )
    output = Output(quiet=quiet, as_json=json)
    if foxglove and not online:
        raise ValueError("--foxglove: needs --online (dqslam view --foxglove plays results)")
    if (mcap is not None or foxglove) and find_spec("foxglove") is None:
        raise ValueError("MCAP needs foxglove-sdk: pip install 'dqslam[mcap]'")
    if mcap is not None:
        refuse_inputs(mcap, inputs)
        if online and out.resolve() in mcap.resolve().parents:
            raise ValueError(
                f"--mcap: {mcap} grows while the session runs, and cannot be in the folder of the "
                "results, which are written at its end"
            )
    # A session shows a line with its state, a batch a bar with the share that is done.
    shown: AbstractContextManager[Callable[[Any], None]] = (
        output.live("loading") if online else output.share("estimating")
    )
    with ExitStack() as stack:
        recorders = []
        if mcap is not None and online:
            recorders.append(stack.enter_context(record_session(mcap)))
        if foxglove:
            served = serve_session(out.name, host, port, in_real_time=True)
            address, recorder = stack.enter_context(served)
            recorders.append(recorder)
            output.line(f"{address} shows the session, for Foxglove")
        show = stack.enter_context(shown)
        result = run_files(
            files.camera,
            files.odometry,
            files.detections,
            replace(options, watch=_all_of(recorders)),
            online=online,
            groundtruth=groundtruth,
            out=out,
            beside={CONFIG: settings_text(context)},
            progress=lambda share, text: show(text if online else share),
        )
        if recorders:
            result_scene = build_scene(io.load_results(out))
            for recorder in recorders:
                recorder.finish(result_scene)
    output.document(result.report)
    show_report(output, result.report)
    output.line(f"wrote {out}")
    if mcap is not None:
        if not online:
            write_mcap(build_scene(io.load_results(out)), mcap)
        output.line(f"wrote {mcap}")
    if result.report["doubts"]:
        raise typer.Exit(DOUBTFUL)


def _all_of(recorders: "list[SessionRecorder]") -> "Callable[[OnlineSlam, Step], None] | None":
    """Return what gives a step to each recorder; None without any."""
    if not recorders:
        return None

    def watch(slam: "OnlineSlam", step: "Step") -> None:
        for recorder in recorders:
            recorder(slam, step)

    return watch


def parse_shapes(given: str) -> "Shape | ClassShapes":
    """Return the shape of that name, or read a file with the shapes of classes."""
    from dqslam._core import Shape
    from dqslam.assumptions import load_shapes

    if given.upper() in Shape.__members__:
        return Shape[given.upper()]
    if not Path(given).suffix and not Path(given).exists():
        names = ", ".join(name.lower() for name in Shape.__members__)
        raise ValueError(f"--shapes: {given!r} is none of {names}, and no file")
    return load_shapes(given)


def split_names(text: str | None) -> tuple[str, ...]:
    """Split text like "mount, focal"; None gives no names."""
    return () if text is None else tuple(name.strip() for name in text.split(","))


def parse_noise(option: str, text: str | None) -> "OdometryNoise | None":
    """Read text like "translation=0.02,rotation=0.01"; both are needed. None gives None."""
    from dqslam.assumptions import OdometryNoise

    if text is None:
        return None
    try:
        pairs = [part.split("=") for part in text.split(",")]
        values = {name.strip(): float(value) for name, value in pairs}
    except ValueError:
        values = {}
    if len(values) != 2 or set(values) != {"translation", "rotation"}:
        raise ValueError(f'{option}: {text!r} is not like "{NOISE}"')
    try:
        return OdometryNoise(values["translation"], values["rotation"])
    except ValueError as error:
        raise ValueError(f"{option}: {error}") from None
