"""Rules of placement on recordings with a truth: eight tables, and cars that stand on a road."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import dqslam as dq
from dqslam import io
from dqslam._checks import Floats
from dqslam.io.recording import Ids

_FOLDER = Path(os.environ.get("DQSLAM_REALDATA", "../shared/realdata"))
YCB = ("0049", "0051", "0053", "0055", "0057", "0059")
TABLE = (dq.PlacementRule("on", None, "plane", 0.01),)
ROAD = (dq.PlacementRule("on", None, "plane", 0.1),)


@dataclass(frozen=True, eq=False)
class Case:
    """A recording and what is true of it, in the world of its odometry."""

    name: str
    recording: dq.Recording
    options: dq.RunOptions
    rules: tuple[dq.PlacementRule, ...]
    up: Floats
    """Unit vector, shape (3,)."""
    bottoms: dict[str, float]
    """Heights along up of the plane below each object, meters, by name: its class on a table, where
    each class occurs once, its id on the road."""
    centers: dict[str, Floats]
    """Meters, by name, for the objects whose place is known."""
    sides: dict[str, Floats]
    """Meters, from the longest, by name."""

    def names(self, estimate: dq.Estimate) -> list[str]:
        """Return the names of the objects of an estimate."""
        if self.options.trust_ids < 1.0:
            return list(estimate.class_names)
        return [str(one) for one in estimate.object_ids.tolist()]


def _rows(path: Path) -> list[dict[str, str]]:
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def _numbers(row: dict[str, str], names: str) -> Floats:
    return np.array([float(row[name]) for name in names.split()])


def _load(folder: Path, odometry: str, boxes: str, ids: Ids, camera: Path) -> dq.Recording:
    return io.load_recording(
        camera / "camera.json", folder / odometry, folder / boxes, ids=ids, min_score=0.5
    )[0]


def ycb(scene: str) -> Case:
    """Return a table of YCB-Video, whose truth is in another world than its odometry."""
    from scipy.spatial.transform import Rotation

    folder = _FOLDER / "ycbv_orbslam3" / scene
    poses = [
        io.read_trajectory(folder / name).world_from_camera[:, 3:]
        for name in ("odometry_orbslam3_rgbd.txt", "groundtruth.txt")
    ]
    turn = (Rotation.from_quat(poses[1]) * Rotation.from_quat(poses[0]).inv()).mean()
    present = _rows(folder / "objects_present.csv")
    # The table is z = 0 in the world of the truth; objects link its height to the odometry's world.
    links = [
        _numbers(row, "gt_x gt_y gt_z") - turn.apply(_numbers(row, "odo_x odo_y odo_z"))
        for row in present
    ]
    annotated = folder / "objects_gt.csv"
    known = _rows(annotated) if annotated.is_file() else []
    known = [row for row in known if row["world"] == "odometry"]
    sizes = {row["class_name"]: _numbers(row, "size_1 size_2 size_3") for row in present}
    height = -float(np.median(links, axis=0)[2])
    recording = _load(
        folder, "odometry_orbslam3_rgbd.txt", "detections_yolox.csv", "class_id", folder
    )
    return Case(
        f"YCB {scene}",
        recording,
        dq.RunOptions(trust_ids=0.9, estimates_noise=True),
        TABLE,
        turn.inv().apply([0.0, 0.0, 1.0]),
        dict.fromkeys(sizes, height),
        {row["class_name"]: _numbers(row, "tx ty tz") for row in known},
        sizes,
    )


def lmo(detector: str) -> Case:
    """Return the table of LM-O at its true poses; two of its objects were moved by hand."""
    from scipy.spatial.transform import Rotation

    folder = _FOLDER / "bop_lmo" / "seg_0703_1001"
    boxes = f"detections_{detector}.csv"
    recording = _load(folder, "groundtruth.txt", boxes, "class_id", folder.parent)
    rest = [row for row in _rows(folder / "objects_gt.csv") if row["static"] == "1"]
    up = np.array([0.0, 0.0, 1.0])
    bottoms, centers, sides = {}, {}, {}
    for row in rest:
        one, center = row["class_name"], _numbers(row, "tx ty tz")
        turn = Rotation.from_quat(_numbers(row, "qx qy qz qw")).as_matrix()
        size = _numbers(row, "size_x size_y size_z")
        bottoms[one] = float(center[2] - np.abs(0.5 * turn[2] * size).sum())
        centers[one], sides[one] = center, np.sort(size)[::-1]
    return Case(
        f"LM-O {detector}",
        _of_objects(recording, [int(row["object_id"]) for row in rest]),
        dq.RunOptions(trust_ids=0.9, mode=dq.Mode.MAPPING),
        TABLE,
        up,
        bottoms,
        centers,
        sides,
    )


def kitti() -> Case:
    """Return the labeled cars at rest of a drive, at the poses of stereo odometry."""
    folder = _FOLDER / "kitti_tracking" / "0005"
    recording = _load(folder, "trajectory_reference.txt", "boxes_gt.csv", "track_id", folder)
    rest = [row for row in _rows(folder / "objects_gt_world.csv") if row["static"] == "1"]
    centers = {row["track_id"]: _numbers(row, "cx cy cz") for row in rest}
    sides = {row["track_id"]: _numbers(row, "length height width") for row in rest}
    return Case(
        "KITTI 0005",
        _of_objects(recording, [int(one) for one in centers]),
        dq.RunOptions(mode=dq.Mode.MAPPING, size_prior=dq.SizePrior(np.log(1.1), np.log(1.7))),
        ROAD,
        np.array([0.0, -1.0, 0.0]),
        {one: float(-center[1] - 0.5 * sides[one][1]) for one, center in centers.items()},
        centers,
        {one: np.sort(side)[::-1] for one, side in sides.items()},
    )


def _of_objects(recording: dq.Recording, ids: list[int]) -> dq.Recording:
    boxes = recording.detections
    return replace(recording, detections=boxes.select(np.isin(boxes.object_id, ids)))


def first_images(case: Case, share: float) -> Case:
    """Return the case with the boxes of a part of its images only, from the first on."""
    boxes = case.recording.detections
    images = np.unique(boxes.pose)
    last = images[max(int(share * len(images)), 2) - 1]
    part = replace(case.recording, detections=boxes.select(boxes.pose <= last))
    return replace(case, recording=part)


def errors(case: Case, result: dq.RunResult) -> Floats:
    """Return medians over objects: of centers [m], lowest points [m], sides (relative)."""
    estimate = result.estimate
    solids = estimate.solids
    lowest = solids.centers @ case.up - solids.support(case.up)
    sides = 2.0 * estimate.semi_axes
    centers, bottoms, relative = [], [], []
    for row, one in enumerate(case.names(estimate)):
        if one in case.centers:
            centers.append(float(np.linalg.norm(estimate.centers[row] - case.centers[one])))
        if one in case.sides:
            bottoms.append(abs(float(lowest[row]) - case.bottoms[one]))
            relative += np.abs(sides[row] / case.sides[one] - 1.0).tolist()
    return np.array([np.median(one) if one else np.nan for one in (centers, bottoms, relative)])


def plane_errors(case: Case, result: dq.RunResult) -> tuple[float, float, float]:
    """Return the error of up [degrees], its sigma, and that of the largest plane's height [m].

    The height is compared where the objects on the plane are.
    """
    found, estimate = result.report["placements"], result.estimate
    up = np.array(found["up"])
    off = float(np.degrees(np.arccos(np.clip(up @ case.up, -1.0, 1.0))))
    sigma = found["up_sigma_deg"]
    planes = [plane for plane in found["planes"] if plane["object_ids"]]
    if not planes:
        return off, np.nan if sigma is None else sigma, np.nan
    plane = max(planes, key=lambda one: len(one["object_ids"]))
    on_it = np.isin(estimate.object_ids, plane["object_ids"])
    middle = estimate.centers[on_it].mean(axis=0)
    foot = middle - (up @ middle - plane["height_m"]) * up
    names = [name for name, on in zip(case.names(estimate), on_it, strict=True) if on]
    true = np.median([case.bottoms[name] for name in names if name in case.bottoms])
    return off, np.nan if sigma is None else sigma, abs(float(foot @ case.up - true))


def rows_of(case: Case) -> Iterator[str]:
    """Yield a row of the table without rules, and with them, with up found and told."""
    told = dq.PlacementRules(case.rules, tuple(case.up.tolist()))
    variants = {"no rules": None, "plane": dq.PlacementRules(case.rules), "plane, up told": told}
    for name, rules in variants.items():
        result = dq.run(case.recording, replace(case.options, placements=rules))
        if not len(result.estimate.object_ids):
            yield f"| {case.name} | no object is found | | | | | |"
            return
        center, bottom, side = errors(case, result)
        row = (
            f"| {case.name} | {name} | {100 * center:.2f} | {100 * bottom:.2f} | "
            f"{100 * side:.1f} % |"
        )
        if rules is None:
            yield f"{row} | |"
            continue
        off, sigma, height = plane_errors(case, result)
        yield f"{row} {100 * height:.2f} | {off:.1f}, {sigma:.1f} |"


def tabulate(
    cases: Annotated[
        list[str] | None, typer.Argument(help="A scene like 0049, lmo, kitti; by default all.")
    ] = None,
    share: Annotated[float, typer.Option(help="Of the images, from the first one on.")] = 1.0,
) -> None:
    """Run tables of YCB-Video and LM-O, and KITTI tracking 0005, in $DQSLAM_REALDATA."""
    made: dict[str, list[Callable[[], Case]]] = {scene: [partial(ycb, scene)] for scene in YCB}
    made["lmo"] = [partial(lmo, "fasterrcnn"), partial(lmo, "maskrcnn")]
    made["kitti"] = [kitti]
    typer.echo(
        "| recording | rules | centers, cm | lowest points, cm | sides | plane, cm | up: error, "
        "sigma, degrees |"
    )
    typer.echo("|---|---|---|---|---|---|---|")
    for name in cases or made:
        if name not in made:
            raise typer.BadParameter(f"{name!r} is none of {', '.join(made)}")
        for make in made[name]:
            for row in rows_of(first_images(make(), share)):
                typer.echo(row)
