"""Where a camera is in a map, from the boxes of one image or of several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam._checks import Floats, Ints, as_floats, reject_rows
from dqslam.assumptions import OdometryNoise
from dqslam.io import Results
from dqslam.io.results import load_map_results
from dqslam.lens import camera_with, lens_of
from dqslam.places.landmarks import read_landmarks
from dqslam.places.location.boxes import LabeledBoxes, check_labels, label_boxes, labels_of_array
from dqslam.places.location.place_map import ImageBoxes, PlaceMap
from dqslam.places.location.score import SE3, Frame
from dqslam.places.location.search import Places, find_places
from dqslam.recording import Detections

# A model of independent errors is too sure of itself, and the more so the more boxes it takes for
# independent: of its log-odds m with k objects, offset + slope * m - by_object * ln k is right, as
# counted in simulated places (docs/locate.md). An object that fits a wrong pose by chance does so
# in all images of a sequence: its boxes count as one, by their mean.
CALIBRATED_OFFSET, CALIBRATED_SLOPE, CALIBRATED_BY_OBJECT = 1.3, 0.36, 2.3
# Images of a sequence that vote, at most: those with the most boxes.
MOST_IMAGES = 12
# An image of fewer boxes is left out; a pose of fewer objects is no answer.
FEWEST_BOXES, FEWEST_OBJECTS = 2, 3
# The largest sigma of a position that is an answer, as a share of the distance of sight.
MOST_SIGMA = 0.06


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pose that may be that of the camera."""

    pose: Floats
    """world_from_camera, shape (7,)."""
    covariance: Floats
    """In the tangent of the pose, translation [m], then rotation [rad]; shape (6, 6)."""
    probability: float
    """That the camera is there, and not elsewhere in the map or out of it."""


@dataclass(frozen=True, eq=False)
class Location:
    """The answer to the question where a camera is, which may be that nothing is sure."""

    reason: str
    """Why there is no answer; empty if there is one."""
    candidates: tuple[Candidate, ...]
    """All poses that were found, the most probable first; the first is the answer if there is one.
    """
    object_id: Ints
    """Object that each box shows at the first candidate, -1 for none; shape (b,)."""
    image: int
    """Row of the pose of the image that the poses are of: the last one."""

    @property
    def is_found(self) -> bool:
        """Whether there is an answer."""
        return not self.reason

    @property
    def pose(self) -> Floats:
        """world_from_camera, shape (7,); ValueError with the reason if there is no answer."""
        return self._answer().pose

    @property
    def covariance(self) -> Floats:
        """Covariance of the pose in its tangent, (6, 6); ValueError if there is no answer."""
        return self._answer().covariance

    @property
    def confidence(self) -> float:
        """Probability of the first candidate, 0 without any."""
        return self.candidates[0].probability if self.candidates else 0.0

    def _answer(self) -> Candidate:
        if self.reason:
            raise ValueError(f"locate: no answer: {self.reason}")
        return self.candidates[0]

    def __repr__(self) -> str:
        """Show the position and the confidence, or the reason of no answer."""
        if self.reason:
            return f"Location(no answer: {self.reason})"
        where = ", ".join(f"{x:.2f}" for x in self.pose[:3])
        return f"Location({where}; confidence {self.confidence:.4f})"


def locate(
    known: PlaceMap | Results | str | Path,
    boxes: Detections,
    camera: _core.Camera,
    *,
    labels: Sequence[Mapping[str, float]] | Floats | None = None,
    odometry: ArrayLike | None = None,
    odometry_noise: OdometryNoise | None = None,
    min_confidence: float = 0.9,
) -> Location:
    """Find where a camera is in a map, from boxes and their classes, or say that it is not sure.

    Parameters
    ----------
    known
        The map: results, their folder, a ``map.json`` or CSV of objects with sizes, or
        ``PlaceMap.of(results)``, which saves time if many images are located.
    boxes
        Boxes in undistorted pixels. Ids of objects are not used. A box may be of its other classes,
        too, in proportion to their scores. Boxes of different classes that overlap by an
        intersection over union of 0.8 count as one box with several labels.
    camera
        The camera of the image, which may differ from the map's. Its mount is ignored.
    labels
        What each box may be instead of its classes: names with weights, shape (m,), or an array of
        probabilities, shape (m, c), whose columns are the classes of ``boxes.class_names`` by their
        numbers.
    odometry
        Poses of the camera in a frame of its own, world_from_camera, shape (n, 7), if the boxes are
        of several images: ``boxes.pose`` are rows of it.
    odometry_noise
        Of a step of that odometry; by default ``OdometryNoise()``.
    min_confidence
        The least probability of an answer.

    Raises
    ------
    ValueError
        If the arguments do not fit each other, or the map has no ellipsoid.
    FileError
        If a folder has no results.

    Examples
    --------
    An image of a simulated drive, in the map that the drive made:

    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=1)
    >>> estimate, summary = dq.solve(dq.build_graph(recording))
    >>> dq.save_estimate(estimate, "results/orbit", detections=recording.detections)
    >>> boxes = recording.detections.select(recording.detections.pose == 20)
    >>> found = dq.locate("results/orbit", boxes, recording.camera)
    >>> found.is_found
    True
    """
    if not 0.0 < min_confidence < 1.0:
        raise ValueError(f"min_confidence is {min_confidence:g}, not between 0 and 1")
    if labels is not None:
        labels = labels_of_array(labels, boxes)
        check_labels(labels, len(boxes))
    place = known if isinstance(known, PlaceMap) else place_of(known)
    lens = lens_of(camera)
    bare = camera_with(camera, lens, robot_from_camera=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    images = np.unique(boxes.pose)
    last = int(images[-1]) if len(images) else 0
    poses = _poses(images, odometry)
    labeled = [label_boxes(boxes, image, labels) for image in _voters(boxes, images)]
    frames = [
        Frame(
            ImageBoxes.of(place, bare, one),
            *_offset(poses, int(boxes.pose[one.row[0]]), last, odometry_noise or OdometryNoise()),
        )
        for one in labeled
    ]
    places = find_places(place, bare, frames)
    return _answer(place, places, labeled, len(boxes), last, min_confidence)


def place_of(known: Results | str | Path) -> PlaceMap:
    """Prepare a map: results, their folder, or a ``map.json`` or CSV of objects with sizes."""
    if isinstance(known, Results):
        return PlaceMap.of(known)
    if Path(known).is_file():
        return PlaceMap.of_landmarks(read_landmarks(known))
    return PlaceMap.of(load_map_results(known))


def _poses(images: Ints, odometry: ArrayLike | None) -> Floats:
    """Return the poses of odometry; any, if there is one image."""
    if odometry is not None:
        poses = as_floats("odometry", odometry, [None, 7])
        norm = np.linalg.norm(poses[:, 3:], axis=1)
        reject_rows("odometry", np.abs(norm - 1.0) > 1e-6, "quaternion is not of norm 1", poses)
        if len(images) and (images[0] < 0 or images[-1] >= len(poses)):
            raise ValueError(f"boxes.pose: {images[-1]} is no row of the {len(poses)} of odometry")
        return poses
    if len(images) > 1:
        raise ValueError(f"locate: boxes of {len(images)} images, and no odometry between them")
    return np.zeros((0, 7))


def _voters(boxes: Detections, images: Ints) -> list[int]:
    """Return the images that vote: those of the most boxes, of as many parts as may vote."""
    counts = np.array([np.sum(boxes.pose == image) for image in images.tolist()], dtype=int)
    parts = np.array_split(np.arange(len(images)), min(MOST_IMAGES, max(len(images), 1)))
    best = [part[np.argmax(counts[part])] for part in parts if len(part)]
    return [int(images[row]) for row in best if counts[row] >= FEWEST_BOXES or len(best) == 1]


def _offset(poses: Floats, image: int, last: int, noise: OdometryNoise) -> tuple[Floats, Floats]:
    """Return the pose of an image in the last one, and its covariance from the steps between."""
    if image == last:
        return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), np.zeros((6, 6))
    steps = abs(last - image)
    offset = _core.between(SE3, poses[[last]], poses[[image]])[0]
    covariance = noise.covariance(1)[0] * steps
    # The error of the heading, made halfway in the mean, moves the position sideways.
    lever = float(offset[:3] @ offset[:3]) / 3.0
    covariance[:3, :3] += covariance[5, 5] * lever * np.eye(3)
    return offset, covariance


def _answer(
    place: PlaceMap,
    places: Places,
    labeled: list[LabeledBoxes],
    count: int,
    image: int,
    min_confidence: float,
) -> Location:
    shown = np.full(count, -1)
    first = places.matches.hypothesis == 0
    for frame, box, row in zip(
        places.matches.frame[first],
        places.matches.box[first],
        places.matches.object_row[first],
        strict=True,
    ):
        shown[labeled[frame].row[box]] = place.object_ids[row]
    matches, objects = int(first.sum()), len(np.unique(places.matches.object_row[first]))
    candidates = tuple(
        Candidate(pose, covariance, probability)
        for pose, covariance, probability in zip(
            places.poses,
            places.covariance,
            _probabilities(places, matches, objects),
            strict=True,
        )
    )
    reason = _reason(place, candidates, places, labeled, objects, min_confidence)
    return Location(reason, candidates, shown, image)


def _probabilities(places: Places, matches: int, objects: int) -> list[float]:
    """Return the calibrated probability of each place; the rest is that of no place of these.

    At the best one, so many boxes show so many objects.
    """
    if not len(places.log_odds):
        return []
    every = np.append(places.log_odds, places.log_elsewhere)
    others = np.logaddexp.reduce(every[1:])
    margin = (every[0] - others) * objects / max(matches, 1)
    log_odds = CALIBRATED_OFFSET + CALIBRATED_SLOPE * margin
    log_odds -= CALIBRATED_BY_OBJECT * np.log(max(objects, 1))
    best = float(1.0 / (1.0 + np.exp(-log_odds)))
    # A rival is at most as probable as the best one.
    rivals = np.minimum(np.exp(every[1:-1] - others) * (1.0 - best), best)
    return [best, *rivals.tolist()]


def _reason(
    place: PlaceMap,
    candidates: tuple[Candidate, ...],
    places: Places,
    labeled: list[LabeledBoxes],
    objects: int,
    min_confidence: float,
) -> str:
    """Say why there is no answer, or nothing if there is one."""
    known = set(place.sensor.labels)
    named = sum(any(name in known for name in names) for one in labeled for names in one.labels)
    total = sum(len(one.row) for one in labeled)
    counted = f"{named} of {total} boxes are of classes in the map"
    if not candidates and places.is_given_up:
        return (
            f"ambiguous: {counted}, but these classes have too many objects among the "
            f"{len(place.object_ids)} of the map for sizes and distances to tell them apart"
        )
    if not candidates:
        return f"too few: {counted}, and no three agree about a pose"
    best = candidates[0]
    if objects < FEWEST_OBJECTS:
        return f"too few: {counted}, and {objects} show objects at the best pose"
    if best.probability < min_confidence:
        rivals = np.logaddexp.reduce(places.log_odds[1:], initial=-np.inf)
        if rivals > places.log_elsewhere:
            return (
                f"ambiguous: {_at(best)} with probability {best.probability:.3f}, "
                f"or {_at(candidates[1])} with {candidates[1].probability:.3f}"
            )
        return (
            f"too few: {counted}, and the best pose, {_at(best)}, "
            f"has a probability of {best.probability:.3f}"
        )
    sigma = float(np.sqrt(np.linalg.eigvalsh(best.covariance[:3, :3])[-1]))
    if sigma > MOST_SIGMA * place.sensor.sight:
        return f"too few: {counted}, and the position is known to {sigma:.2f} m only"
    return ""


def _at(candidate: Candidate) -> str:
    return "({})".format(", ".join(f"{x:.2f}" for x in candidate.pose[:3]))
