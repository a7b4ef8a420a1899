"""The output of ``dqslam run``: a report as tables and lines."""

from typing import TYPE_CHECKING, Any

from dqslam.cli.output import Output

if TYPE_CHECKING:
    from rich.table import Table


def show_report(output: Output, report: dict[str, Any]) -> None:
    """Show a report: an overview, its objects, and remarks on the result."""
    output.table(_overview(report))
    if report["objects"]:
        output.table(_objects(report["objects"]))
        output.line("")
        if any(entry["doubt"] is not None for entry in report["objects"]):
            output.line("? the size or shape is not to be believed: see the warnings")
    tracks = report["tracks"]
    if tracks is not None and tracks["moving"]:
        output.table(_moving(tracks["moving"]))
        output.line("")
    lines = [f"object {name} is not in the map: {why}" for name, why in _dropped(report)]
    lines += [f"under-constrained: {sentence}" for sentence in report["under_constrained"]]
    if report["solver"] is None:
        lines.append("no object fits a world at rest: the trajectory is the odometry")
    else:
        lines.append(_solver(report["solver"]))
    for line in lines:
        output.line(line)
    for warning in report["warnings"]:
        output.warn(warning)


def _shapes(shapes: dict[str, Any]) -> str:
    found = list(shapes["shapes"].values())
    counts = ", ".join(f"{found.count(name)} {name}s" for name in ("cuboid", "cylinder"))
    if not shapes["rejected"]:
        return counts
    return (
        f"{counts}; {len(shapes['rejected'])} objects might be one, but boxes that took no part do "
        "not show it"
    )


def _placements(placements: dict[str, Any]) -> str:
    rows = placements["placements"]
    counts = f"{sum(row['holds'] for row in rows)} of {len(rows)} hold"
    planes = [
        f"{len(plane['object_ids'])} objects at {plane['height_m']:.3g} m ± {plane['sigma_m']:.2g}"
        for plane in placements["planes"]
    ]
    return "; ".join([counts, *planes])


def _dropped(report: dict[str, Any]) -> list[tuple[str, str]]:
    return sorted(report["dropped_objects"].items(), key=lambda item: int(item[0]))


def _solver(solver: dict[str, Any]) -> str:
    return (
        f"solver: {solver['message']} ({solver['iterations']} iterations, "
        f"{solver['rejected_steps']} rejected, {solver['seconds']:.2f} s)"
    )


def _overview(report: dict[str, Any]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    boxes = report["boxes"]
    table = Table(box=SIMPLE_HEAD, show_header=False)
    table.add_row("poses", f"{report['poses']}, {report['keyframes']} of them keyframes")
    table.add_row(
        "boxes",
        f"{boxes['count']} of {len(report['objects'])} objects, {boxes['of_dropped_objects']} of "
        f"objects not in the map, {boxes['unassigned']} of none",
    )
    table.add_row("left out", _left_out(report["dropped_boxes"], report["ids"]))
    if boxes["count"]:
        table.add_row(
            "χ² of a box",
            f"median {boxes['chi2_median']:.2f} (3.36 expected); {boxes['outlier_share']:.1%} do "
            f"not fit (above 13.28), {boxes['not_in_front']} of them not even in front",
        )
    if report["shapes"] is not None:
        table.add_row("shapes", _shapes(report["shapes"]))
    if report["placements"] is not None:
        table.add_row("placements", _placements(report["placements"]))
    table.add_row("re-projection", _reprojection(report["reprojection"]))
    table.add_row("noise of a box edge", _box_noise(report["box_noise"]))
    table.add_row("odometry noise", _noise(report["odometry_noise"]))
    if report["estimated_calibration"]:
        table.add_row("estimated calibration", _calibration(report["estimated_calibration"]))
    if report["evidence"] is not None:
        table.add_row("boxes held out", _evidence(report["evidence"]))
    error = report["trajectory_error"]
    if error is None:
        table.add_row("trajectory error", "unknown: there is nothing to compare with")
        return table
    for name, title in (("ate_rmse_m", "rmse after alignment"), ("mean_m", "mean, same start")):
        before, after = error["before"][name], error["after"][name]
        word = "better" if after < before else "worse" if after > before else "unchanged"
        table.add_row(title, f"odometry {before:.4f} m, estimate {after:.4f} m: {word}")
    return table


def _reprojection(overlap: dict[str, Any]) -> str:
    if overlap["iou_median"] is None:
        return "no box shows an object of the map"
    which = "held out" if overlap["held_out"] else "used"
    return (
        f"median IoU {overlap['iou_median']:.2f} of the boxes {which}; "
        f"{overlap['explained_share']:.0%} of those of mapped classes reach 0.5"
    )


def _box_noise(noise: dict[str, Any]) -> str:
    def part(of: dict[str, Any]) -> str:
        return f"{of['pixels']:.2g} px and {of['relative']:.1%} of the side"

    if "repeated" not in noise:
        return part(noise)
    return (
        f"{part(noise['new'])}, new in each image; {part(noise['repeated'])}, "
        "the same from the same side"
    )


def _calibration(estimated: dict[str, dict[str, Any]]) -> str:
    return "\n".join(
        f"{name} {one['value']:.4g} ± {one['sigma']:.2g} {one['unit']}".rstrip()
        for name, one in estimated.items()
    )


def _evidence(evidence: dict[str, Any]) -> str:
    if evidence["log_likelihood_gain"] is None:
        return "none: the estimate cannot be compared with the odometry"
    return (
        f"{evidence['objects_for']} objects fit better to the path by the others than to the "
        f"odometry, {evidence['objects_against']} worse (log likelihoods differ by "
        f"{evidence['log_likelihood_gain']:.4g}): "
        + ("the odometry is kept" if evidence["odometry_kept"] else "the estimate is used")
    )


def _noise(noise: dict[str, Any]) -> str:
    if noise["from"] == "given":
        return "given"
    return (
        f"estimated: {1e3 * noise['translation_m']:.2f} mm, "
        f"{1e3 * noise['rotation_rad']:.2f} mrad a step"
    )


def _left_out(dropped: dict[str, Any], ids: str) -> str:
    few = dropped["few_boxes"]
    reasons = {
        "below the least score": dropped["below_min_score"],
        "beyond the range of the lens": dropped["beyond_lens"],
        f"without {ids}": dropped["without_id"],
        "without a pose of their time": dropped["without_pose"],
        "beside a better box of the same object": dropped["repeated"],
        f"of objects with fewer than 3: {', '.join(map(str, few))}": sum(few.values()),
    }
    return "\n".join(f"{count} {why}" for why, count in reasons.items() if count) or "none"


def _objects(objects: list[dict[str, Any]]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, padding=0, show_edge=False)
    headings = ["id", "class", "boxes", "center, m", "±, m", "size, m", "χ²", "outliers"]
    has_shapes = any(entry["shape"] not in (None, "ellipsoid") for entry in objects)
    if has_shapes:
        headings.insert(6, "shape")
    for heading in headings:
        table.add_column(heading, justify="left" if heading in ("class", "shape") else "right")
    for entry in objects:
        sigma, axes = entry["center_sigma_m"], entry["half_lengths_m"] or entry["semi_axes_m"]
        table.add_row(
            str(entry["id"]) if entry["doubt"] is None else f"{entry['id']} ?",
            escape(entry["class_name"]),
            str(entry["observations"]),
            " ".join(f"{value:.2f}" for value in entry["center_m"]),
            "unknown" if sigma is None else f"{sigma:.2g}",
            "unknown" if None in axes else "x".join(f"{2.0 * axis:.2g}" for axis in axes),
            *([entry["shape"] or "none"] if has_shapes else []),
            "none" if entry["chi2_median"] is None else f"{entry['chi2_median']:.2f}",
            "none" if entry["outlier_share"] is None else f"{entry['outlier_share']:.0%}",
        )
    return table


def _moving(moving: list[dict[str, Any]]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, padding=0, show_edge=False, title="what moves")
    headings = (
        *("track", "class", "does", "images", "from, s", "to, s"),
        *("path, m", "speed,\nm/s", "±", "size, m"),
    )
    for heading in headings:
        table.add_column(heading, justify="left" if heading in ("class", "does") else "right")
    for one in moving:
        table.add_row(
            str(one["id"]),
            escape(one["class_name"]),
            one["behavior"],
            str(one["images"]),
            f"{one['first_s']:.2f}",
            f"{one['last_s']:.2f}",
            f"{one['length_of_path_m']:.3g}",
            f"{one['speed_median_m_s']:.2g}",
            f"{one['speed_sigma_m_s']:.2g}",
            "x".join(f"{side:.2g}" for side in one["sides_m"]),
        )
    return table
