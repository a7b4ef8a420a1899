"""One map, and all trajectories in its frame, from maps of one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam._files import write_text
from dqslam._outputs import output_set
from dqslam._repr import counted
from dqslam.io.results import Results
from dqslam.places.alignment.consensus import MotionName, align_landmarks
from dqslam.places.alignment.result import Alignment, CannotTellError
from dqslam.places.landmarks import Landmarks, Source, read_landmarks
from dqslam.places.merging.files import write_merged
from dqslam.places.merging.fusion import Fused, fuse
from dqslam.places.merging.together import (
    Paths,
    Solved,
    joined_ids,
    motion_of_part,
    paths_of,
    solve_maps,
    solved_of,
    why_not_together,
)

WRITTEN_BY = "dqslam merge"


@dataclass(frozen=True, eq=False)
class Part:
    """One of the maps, as it is in the merged one."""

    name: str
    alignment: Alignment | None
    """From the maps merged before to this one; None for the first."""
    object_ids: Ints
    """Its own ids, shape (o,)."""
    merged_ids: Ints
    """Ids of the same objects in the merged map, shape (o,)."""
    merged_from_map: Floats
    """Takes its coordinates into the frame of the first map, shape (4, 4)."""
    covariance: Floats
    """Of that motion, a small one in the frame of the first map, (6, 6)."""
    results: Results | None
    """Its files, if it was read from a folder of results."""
    poses: Floats
    """merged_from_camera of its trajectory, shape (n, 7); empty without one."""
    initial_poses: Floats
    """The same by its odometry alone."""
    pose_covariances: Floats
    """Of its poses in their own frames, m and rad, shape (n, 6, 6); NaN if unknown."""
    why_fused: str = ""
    """Why its problem was not solved together with those before, but its map fused with theirs;
    empty if it was solved together, and for the first map."""


@dataclass(frozen=True, eq=False)
class MergedMap:
    """Maps of one place as one."""

    landmarks: Landmarks
    """All objects in the frame of the first map, each once."""
    parts: tuple[Part, ...]
    """The maps in the order in which they were merged."""
    solved: Solved | None = None
    """The problem of all maps, and its solution; None if a map was fused."""

    def __repr__(self) -> str:
        """Show how many objects there are, of how many maps."""
        objects = counted(len(self.landmarks), "object")
        return f"MergedMap({objects} of {counted(len(self.parts), 'map')})"


def merge(
    *maps: Source | Landmarks,
    out: str | Path | None = None,
    motion: MotionName = "auto",
    sigma: float | None = None,
    beside: Mapping[str, str] | None = None,
) -> MergedMap:
    """Merge maps of one place: align them, join what is in several, and keep all trajectories.

    The frame is that of the first map, and its objects keep their ids. Another map is merged as
    soon as it can be aligned with those before, one with a problem before one without. An object
    that several maps have is where their covariances weigh it, with a covariance that knows that
    the errors of one map are alike.
    Its size and orientation are those of the map that knows them best.

    Folders of results with a ``graph.npz`` are solved again as one problem, as by ``merge_graphs``,
    if they have one camera: objects of several maps are one variable, and all trajectories are
    corrected. Other maps are fused with these afterwards by the covariances in their files, and
    their trajectories are moved as they are. ``Part.why_fused`` says why.

    Parameters
    ----------
    out
        Folder for the files of a result, see ``load_results``, and ``merge.json``, which says where
        everything is from. It is new, empty or of an earlier call.
    motion, sigma
        As for ``align``.
    beside
        Texts to write with the files, by their names.

    Raises
    ------
    CannotTellError
        If a map cannot be aligned with the others; the message names it. Nothing is written.
    FileError
        If a map is missing or wrong, or the folder has files of others.

    Examples
    --------
    >>> import dqslam as dq
    >>> dq.merge("first.csv", "second.csv")
    MergedMap(28 objects of 2 maps)
    """
    if len(maps) < 2:
        raise ValueError(f"merge: {counted(len(maps), 'map')}, at least 2 are needed")
    read = [one if isinstance(one, Landmarks) else read_landmarks(one) for one in maps]
    problems = {id(one): solved_of(one) for one in read}
    solved, why = problems[id(read[0])]
    merged = MergedMap(read[0], (_first(read[0]),), solved)
    waiting = sorted(read[1:], key=lambda one: problems[id(one)][0] is None)
    while waiting:
        refused: list[str] = []
        for landmarks in waiting:
            try:
                merged = _add(merged, why, landmarks, problems[id(landmarks)], motion, sigma)
            except CannotTellError as error:
                refused.append(f"{landmarks.name} cannot be aligned with the others: {error}")
                continue
            why = why or merged.parts[-1].why_fused
            waiting = [one for one in waiting if one is not landmarks]
            break
        else:
            raise CannotTellError("; ".join(refused))
    if out is not None:
        inputs = [one for one in maps if isinstance(one, str | Path)]
        with output_set(out, WRITTEN_BY, inputs=inputs) as folder:
            write_merged(merged, folder)
            for name, text in (beside or {}).items():
                write_text(folder / name, text)
    return merged


def _first(landmarks: Landmarks) -> Part:
    results = landmarks.results
    return Part(
        name=landmarks.name,
        alignment=None,
        object_ids=landmarks.object_ids,
        merged_ids=landmarks.object_ids,
        merged_from_map=np.eye(4),
        covariance=np.zeros((6, 6)),
        results=results,
        poses=np.zeros((0, 7)) if results is None else results.poses,
        initial_poses=np.zeros((0, 7)) if results is None else results.initial_poses,
        pose_covariances=np.zeros((0, 6, 6)) if results is None else results.covariances,
    )


def _add(
    merged: MergedMap,
    why: str,
    landmarks: Landmarks,
    problem: tuple[Solved | None, str],
    motion: MotionName,
    sigma: float | None,
) -> MergedMap:
    """Add a map to those before; ``why`` says why these have no problem, if they have none."""
    before = merged.landmarks
    solved, own_why = problem
    alignment, refined = align_landmarks(before, landmarks, motion=motion, sigma=sigma)
    why = why or own_why
    if merged.solved is not None and solved is not None:
        why = why_not_together(merged.solved, solved, alignment)
        if not why:
            try:
                return _solve(merged, landmarks, solved, alignment)
            except (ValueError, RuntimeError) as error:
                why = f"the joint problem was not solved: {error}"
    fused = fuse(before, landmarks, alignment, refined)
    part = _fused_part(landmarks, alignment, fused)
    return MergedMap(fused.landmarks, (*merged.parts, replace(part, why_fused=why)))


def _solve(
    merged: MergedMap, landmarks: Landmarks, second: Solved, alignment: Alignment
) -> MergedMap:
    """Add a map by solving its problem together with that of the maps before."""
    assert merged.solved is not None
    name = f"{merged.landmarks.name} and {landmarks.name}"
    solved, together, joint = solve_maps(merged.solved, second, alignment, name)
    paths, begin = paths_of(joint), 0
    parts = []
    for part in merged.parts:
        mapped = np.isin(part.merged_ids, together.object_ids)
        kept = replace(part, object_ids=part.object_ids[mapped], merged_ids=part.merged_ids[mapped])
        parts.append(_with_poses(kept, paths, begin))
        begin += len(part.poses)
    object_ids, merged_ids = joined_ids(joint, second)
    added = replace(
        _first(landmarks), alignment=alignment, object_ids=object_ids, merged_ids=merged_ids
    )
    parts.append(_with_poses(added, paths, begin))
    return MergedMap(together, tuple(parts), solved)


def _with_poses(part: Part, paths: Paths, begin: int) -> Part:
    """Return a part with its poses in a joint solution, which begin at a row."""
    assert part.results is not None
    matrix, covariance = motion_of_part(paths, part.results.poses, begin)
    rows = slice(begin, begin + len(part.poses))
    return replace(
        part,
        merged_from_map=matrix,
        covariance=covariance,
        poses=paths.poses[rows],
        initial_poses=paths.initial_poses[rows],
        pose_covariances=paths.covariances[rows],
    )


def _fused_part(landmarks: Landmarks, alignment: Alignment, fused: Fused) -> Part:
    results = landmarks.results
    inverse = np.asarray(np.linalg.inv(alignment.b_from_a), dtype=np.float64)
    poses, initial = np.zeros((0, 7)), np.zeros((0, 7))
    covariances = np.zeros((0, 6, 6))
    if results is not None and len(results.poses):
        poses, initial = (_moved(inverse, x) for x in (results.poses, results.initial_poses))
        covariances = _moved_covariances(poses, results.covariances, fused.covariance)
    return Part(
        name=landmarks.name,
        alignment=alignment,
        object_ids=landmarks.object_ids,
        merged_ids=fused.landmarks.object_ids[fused.row_of_b],
        merged_from_map=inverse,
        covariance=fused.covariance,
        results=results,
        poses=poses,
        initial_poses=initial,
        pose_covariances=covariances,
    )


def _moved(matrix: Floats, poses: Floats) -> Floats:
    """Return poses (n, 7) moved by a rigid motion (4, 4)."""
    from scipy.spatial.transform import Rotation

    frame = np.concatenate([matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3]).as_quat()])
    return _core.compose(_core.PoseModel.SE3, np.tile(frame, (len(poses), 1)), poses)


def _moved_covariances(poses: Floats, covariances: Floats, motion: Floats) -> Floats:
    """Add the error of the frame (6, 6) to the covariances of poses (n, 6, 6), which are in it."""
    model = _core.PoseModel.SE3
    adjoint = np.asarray(_core.adjoint(model, _core.inverse(model, poses)))
    return np.asarray(covariances + adjoint @ motion @ adjoint.swapaxes(1, 2))
