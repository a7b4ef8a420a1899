"""Which boxes show the same object: the whole of it, from a recording to objects and poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Ints, reject_rows, require
from dqslam._repr import counted
from dqslam.association.appearance import learn_appearance
from dqslam.association.attempts import make_map
from dqslam.association.first_levels import first_levels, look
from dqslam.association.initiation import MIN_VIEWS
from dqslam.association.keyframes import choose_keyframes
from dqslam.association.labels import Labels
from dqslam.association.noise import StepNoise
from dqslam.association.occlusion import shortened_edges
from dqslam.association.refine import reassign
from dqslam.association.repeats import find_repeats
from dqslam.association.scene_map import ANY_SIZE, SceneMap
from dqslam.association.thinning import fill_in, thin_recording
from dqslam.association.tracklets import link_tracklets
from dqslam.assumptions import BoxNoise, SizePrior, SizePriors
from dqslam.graph import Graph, build_graph
from dqslam.io.span import seconds
from dqslam.recording import Recording

# Trust in ids that are final, and the most where they are not: of tracklets that are linked in the
# image, 1 in 10 goes over to another object.
FINAL, UNSURE = 1.0, 0.9
# Iterations that bring the images between keyframes to where their boxes fit.
FOLLOW_ITERATIONS = 10


@dataclass(frozen=True, eq=False)
class Association:
    """Which boxes show the same object, and the estimate that goes with it."""

    object_id: Ints
    """Of each box of the recording, -1 for none, shape (m,)."""
    keyframes: Ints
    """Rows of the poses whose boxes were used, shape (n,)."""
    scene: SceneMap
    """Poses of the keyframes and objects; row ``j`` is the object ``object_ids[j]``."""
    object_ids: Ints
    """Ids of the objects, -1 for one that was given up, shape (o,)."""
    dropped: dict[int, str]
    """Ids of objects that do not fit a world at rest, and why. Their boxes keep the ids."""
    hidden: Bools
    """Whether a nearer object seems to hide each edge of each box, shape (m, 4)."""
    repeats: Bools
    """Whether each box repeats a surer one of its image, whose object it has, shape (m,)."""
    remarks: tuple[str, ...] = ()
    """Sentences on attempts that were made, and on steps that are no noise."""

    def __repr__(self) -> str:
        """Show how many objects there are, and how many of the boxes show one."""
        shown = int(np.sum(self.object_id >= 0))
        boxes = f"{shown} of {counted(len(self.object_id), 'box')}"
        dropped = f", {len(self.dropped)} dropped" if self.dropped else ""
        return (
            f"Association({counted(int(np.sum(self.object_ids >= 0)), 'object')}, {boxes}{dropped})"
        )

    def build_graph(self) -> Graph:
        """Lay out the keyframes and the objects at rest, by their ids, as ``solve`` needs them.

        Box noise, size prior and the level of the odometry's noise are those of the association.

        Raises
        ------
        ValueError
            When no object was found.
        """
        scene = self.scene
        names = np.append(self.object_ids, -1)
        names[list(scene.labels.dropped)] = -1
        object_id = names[scene.labels.object_rows]
        used = object_id >= 0
        if not used.any():
            raise ValueError("associate has found no object at rest: there is nothing to solve")
        boxes = scene.recording.detections.select(used)
        detections = replace(boxes, object_id=object_id[used])
        return build_graph(
            replace(scene.recording, detections=detections),
            box_noise=scene.box_noise,
            size_prior=scene.size_prior,
        )

    def start(self, graph: Graph) -> _core.State:
        """Return the poses and objects of such a graph as the association has estimated them."""
        row_of = {number: row for row, number in enumerate(self.object_ids.tolist())}
        rows = [row_of[number] for number in graph.object_ids.tolist()]
        return _core.State(self.scene.poses, self.scene.ellipsoids[rows])


def associate(
    recording: Recording,
    *,
    trust: float = UNSURE,
    mode: _core.Mode = _core.Mode.SLAM,
    box_noise: BoxNoise | None = None,
    size_prior: SizePrior | SizePriors | None = None,
    estimates_noise: bool = True,
    progress: Callable[[float], None] = lambda share: None,
) -> Association:
    """Find out which boxes show the same object.

    Of boxes that a detector drew twice on one thing in an image the surest counts, unless ids are
    final. Boxes are linked in the image to tracklets, and of a video the images from new viewpoints
    are chosen. Along the path, the tracklets are given to the objects that they clearly show, by
    the joint covariance of pose and object; objects start from tracklets, or from boxes that meet
    in space. With the whole path known, all boxes are assigned again. Relative positions take no
    part.

    Parameters
    ----------
    recording
        Its object ids are those of a tracker; -1 where there are none.
    trust
        The probability that an id stays with its object, in (0.5, 1]. At 1 ids are final.
    mode
        MAPPING takes the odometry for the truth.
    box_noise, size_prior
        What to assume; the size by default what the objects found have.
    estimates_noise
        Whether the level of the odometry's noise is estimated instead of believed.
    progress
        Called with the share of the work that is done.

    Raises
    ------
    ValueError
        For a trust out of range, or at 1 for boxes without an id.

    Examples
    --------
    A camera that is carried half around a table, and boxes whose ids are not trusted:

    >>> import dqslam as dq
    >>> scenario = dq.load_scenario("orbit")
    >>> path = scenario.path.model_copy(update={"turns": 0.5, "poses": 30})
    >>> recording, truth = dq.simulate(scenario.model_copy(update={"path": path}), seed=1)
    >>> found = dq.associate(recording, trust=0.9)
    >>> graph = found.build_graph()
    >>> dq.solve(graph, start=found.start(graph))[0]
    Estimate(SE3, 30 poses, 8 objects)
    """
    require(recording, Recording, "associate", "recording, dropped = load_recording(...)")
    if not 0.5 < trust <= FINAL:
        raise ValueError(f"trust in ids is {trust:g}, not above 0.5 and at most 1")
    tracker_ids = recording.detections.object_id
    if trust == FINAL:
        unnamed = tracker_ids < 0
        reject_rows("detections.object_id", unnamed, "final ids are needed: the box has none")
    recording = replace(recording, positions=None, measurements=())
    counts = np.arange(len(tracker_ids)) if trust == FINAL else find_repeats(recording.detections)
    single = counts == np.arange(len(counts))
    if not single.all():
        tracker_ids = tracker_ids[single]
        recording = replace(recording, detections=recording.detections.select(single))
    appearance, why_none = None, ""
    if trust < FINAL:
        appearance, why_none = learn_appearance(recording.detections)
    tracklets = link_tracklets(recording, tracker_ids=tracker_ids, appearance=appearance)
    keyframes = choose_keyframes(recording, tracklets)
    used = np.isin(recording.detections.pose, keyframes)
    thin = thin_recording(recording, keyframes)
    learns_steps = estimates_noise and mode == _core.Mode.SLAM
    noise = StepNoise.between(recording, keyframes) if learns_steps else None
    seen = look(thin, tracklets[used], keyframes)
    levels = None if noise is None else first_levels(noise, seen)

    def make_scene(raised: float) -> SceneMap:
        labels = Labels.of(thin.detections, tracklets[used])
        labels.make_room(tracklets=int(tracklets.max(initial=-1)) + 1)
        labels.appearance = appearance
        return SceneMap(
            thin,
            labels,
            box_noise=box_noise or BoxNoise(),
            learns_box_noise=estimates_noise and box_noise is None,
            size_prior=size_prior,
            first_size=ANY_SIZE if seen is None else replace(ANY_SIZE, log_mean=seen.log_size),
            step_noise=noise,
            levels=None if levels is None else raised * levels,
            mode=mode,
            minds_occlusion=True,
        )

    attempt, remarks = make_map(make_scene, trust, progress)
    scene, labels = attempt.scene, attempt.scene.labels
    if trust == FINAL:
        object_id, ids = tracker_ids.copy(), _ids_of(labels, tracker_ids[used])
    else:
        everything = _with_all_images(scene, recording, keyframes, tracklets, used)
        if mode == _core.Mode.SLAM:
            _follow_tracklets(everything)
        reassign(everything, attempt.follower.switch_cost)
        object_id, ids = _numbered(everything.labels.object_rows, len(scene.ellipsoids))
    progress(1.0)
    named = {int(ids[row]): why for row, why in labels.dropped.items()}
    dropped = {name: why for name, why in named.items() if name >= 0}
    if trust == FINAL:
        dropped |= not_found(recording, ids, used)
    remarks += describe_jumps(scene) + ([why_none] if why_none else [])
    hidden = _hidden_edges(scene, recording, keyframes, (object_id, ids))
    of_all = (np.cumsum(single) - 1)[counts]
    return Association(
        object_id[of_all],
        keyframes,
        scene,
        ids,
        dict(sorted(dropped.items())),
        hidden[of_all] & single[:, None],
        ~single,
        tuple(remarks),
    )


def _hidden_edges(
    scene: SceneMap, recording: Recording, keyframes: Ints, named: tuple[Ints, Ints]
) -> Bools:
    """Return which edges others seem to hide, (m, 4), from the ids of boxes and objects."""
    object_id, ids = named
    known = np.flatnonzero((ids >= 0) & scene.labels.takes_part[: len(ids)])
    place = {int(ids[row]): number for number, row in enumerate(known.tolist())}
    shown = np.array([place.get(one, -1) for one in object_id.tolist()], dtype=np.int64)
    covariance = scene.box_noise.covariance(recording.detections.box, recording.camera)
    return shortened_edges(
        recording,
        fill_in(recording, keyframes, scene.poses),
        scene.ellipsoids[known],
        shown,
        np.diagonal(covariance, axis1=1, axis2=2),
    )


def _ids_of(labels: Labels, tracker_ids: Ints) -> Ints:
    """Return the final id of each object, from those of the boxes (b,); -1 of one given up."""
    ids = np.full(len(labels.votes) + 1, -1)
    ids[labels.object_rows] = tracker_ids
    return ids[:-1]


def describe_jumps(scene: SceneMap) -> list[str]:
    """Say which steps of the odometry are jumps."""
    times = scene.recording.timestamps
    return [
        f"the odometry jumps before {seconds(times[step + 1])} s: its noise is believed to be "
        f"{np.sqrt(scene.inflation[step]):.3g} times that of other steps"
        for step in np.flatnonzero(scene.inflation > 1.0).tolist()
    ]


def not_found(recording: Recording, ids: Ints, used: Bools) -> dict[int, str]:
    """Return why final ids are not in the map (ids, (o,)); ``used`` are keyframes' boxes."""
    given, pose = recording.detections.object_id, recording.detections.pose
    reasons: dict[int, str] = {}
    for name in np.setdiff1d(given, ids).tolist():
        views = len(np.unique(pose[used & (given == name)]))
        reasons[name] = (
            f"seen from {views} viewpoints, {MIN_VIEWS} are needed"
            if views < MIN_VIEWS
            else "no place explains its boxes, or they leave its distance open"
        )
    return reasons


def _with_all_images(
    scene: SceneMap, recording: Recording, keyframes: Ints, tracklets: Ints, used: Bools
) -> SceneMap:
    """Return the map with the poses and boxes between the keyframes."""
    cut = _cut_alike(tracklets, recording.detections.pose, used, scene.labels.tracklets)
    labels = Labels.of(recording.detections, cut)
    labels.take_objects(scene.labels)
    steps = None
    if scene.step_noise is not None:
        steps = StepNoise.between(recording, np.arange(len(recording.timestamps)))
    everything = SceneMap(
        recording,
        labels,
        box_noise=scene.box_noise,
        size_prior=scene.size_prior,
        step_noise=steps,
        levels=scene.levels,
        minds_occlusion=scene.minds_occlusion,
    )
    everything.poses = fill_in(recording, keyframes, scene.poses)
    everything.ellipsoids = scene.ellipsoids.copy()
    return everything


def _follow_tracklets(everything: SceneMap) -> None:
    """Bring the poses between keyframes to where the tracklets of known objects fit, for a while.

    Where odometry is worse than boxes, the path between keyframes is too far off to tell which box
    shows which object; the tracklets that go through both keyframes know.
    """
    labels = everything.labels
    known = labels.since(0)
    owner = labels.object_of_tracklet[labels.tracklets]
    labels.assign(np.arange(len(owner)), owner)
    everything.estimate(max_iterations=FOLLOW_ITERATIONS)
    labels.object_rows[:] = -1
    labels.take_objects(known)


def _cut_alike(tracklet: Ints, pose: Ints, used: Bools, cut: Ints) -> Ints:
    """Cut tracklets (m,) at the poses where those of the used boxes (u,) were cut."""
    result = tracklet.copy()
    known_pose = pose[used]
    for number in np.unique(tracklet[used][cut != tracklet[used]]).tolist():
        rows = np.flatnonzero(tracklet == number)
        known = np.flatnonzero(tracklet[used] == number)
        known = known[np.argsort(known_pose[known], kind="stable")]
        last = np.searchsorted(known_pose[known], pose[rows], side="right") - 1
        result[rows] = cut[known[last.clip(min=0)]]
    return result


def _numbered(object_rows: Ints, count: int) -> tuple[Ints, Ints]:
    """Return ids by order of first boxes: of boxes (m,), and of rows (count,); -1 for none."""
    rows, first = np.unique(object_rows[object_rows >= 0], return_index=True)
    ids = np.full(count + 1, -1)
    ids[rows[np.argsort(first)]] = np.arange(len(rows))
    return ids[object_rows], ids[:-1]
