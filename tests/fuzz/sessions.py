"""Sessions with steps that go wrong: each is refused and changes nothing, or all goes on."""

import random
import tempfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import dqslam as dq
from dqslam import Motion, OnlineSlam, StepError
from fuzz.binding import ODD
from fuzz.readers import Wrong

CONFIGURATIONS: tuple[dict[str, Any], ...] = (
    {},
    {"trust_ids": 0.9, "estimates_noise": True},
    {"finds_movers": True},
    {"options": dq.SolveOptions(loss=dq.Loss.CAUCHY)},
)
STEPS = 25


@lru_cache
def _recording(scenario: str) -> tuple[Any, list[dq.Step]]:
    recording, _ = dq.simulate(dq.load_scenario(scenario), seed=2)
    return recording, list(dq.steps_of(recording))


def _odd(values: Any, rng: random.Random) -> Any:
    """Return numbers, one of which is another one."""
    array = np.array(values, dtype=np.float64)
    if array.size:
        place = rng.randrange(array.size)
        old = array.flat[place]
        array.flat[place] = rng.choice((*ODD, -old, 1e3 * old, 1e9 * old, 1e-9 * old, 1.7e12))
    return array


def _mutated(step: dq.Step, rng: random.Random) -> dq.Step:
    part = rng.choice(("box", "object_id", "relative", "covariance", "time", "boxes", "names"))
    motion, boxes = step.odometry, step.boxes
    if part == "time":
        return replace(step, timestamp=rng.choice((*ODD, 1.7e12, step.timestamp - 1e-9)))
    if part == "relative" and motion is not None:
        return replace(step, odometry=Motion(_odd(motion.relative, rng), motion.covariance))
    if part == "covariance" and motion is not None:
        return replace(step, odometry=Motion(motion.relative, _odd(motion.covariance, rng)))
    if part == "box":
        return replace(step, boxes=replace(boxes, box=_odd(boxes.box, rng)))
    count = len(np.asarray(boxes.box))
    if part == "object_id":
        ids = [rng.choice((-2, -1, 0, 1, 5, 2**31, 2**62, 2**63 - 1)) for _ in range(count)]
        return replace(step, boxes=replace(boxes, object_id=np.array(ids, dtype=np.int64)))
    if part == "names":
        return replace(step, boxes=replace(boxes, class_name=["x", "", "\x00", "$a$"][:count]))
    return replace(step, boxes=None)


def _bits(slam: OnlineSlam) -> Any:
    objects = slam.objects
    arrays = (slam.poses, slam.timestamps, objects.object_ids, objects.ellipsoids, slam.keyframes)
    return [one.tobytes() for one in (*arrays, *slam.assignments)], slam.dropped


def try_session(seed: str) -> None:
    """Feed a session with steps, some of them mutated; then polish, save and load it."""
    rng = random.Random(seed)
    recording, steps = _recording(rng.choice(("paper", "orbit")))
    begin = rng.randrange(20, 80)
    slam = OnlineSlam(
        recording.camera, first_pose=recording.odometry.first_pose, **rng.choice(CONFIGURATIONS)
    )
    for step in steps[begin : begin + STEPS]:
        if rng.random() < 0.2:
            slam.polish(background=True).result()
        if rng.random() < 0.3:
            ids = np.full(len(np.asarray(step.boxes.box)), -1)
            step = replace(step, boxes=replace(step.boxes, object_id=ids))
        given = _mutated(step, rng) if rng.random() < 0.3 else step
        before = _bits(slam)
        try:
            slam.add(given.odometry if len(slam) else None, given.boxes, timestamp=given.timestamp)
        except StepError as error:
            if _bits(slam) != before:
                raise Wrong(f"a refused step has changed the session: {error}") from error
        if not np.isfinite(slam.poses).all():
            raise Wrong("poses that are not finite")
    slam.polish()
    with tempfile.TemporaryDirectory() as folder:
        slam.save(Path(folder) / "map")
        OnlineSlam.load(Path(folder) / "map") if len(slam.objects) or not len(slam) else None
