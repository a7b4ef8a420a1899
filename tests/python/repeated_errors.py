"""Boxes whose errors repeat from image to image, drawn as a detector's are."""

from dataclasses import replace

import numpy as np


def with_repeated_errors(made, *, new_px, repeated_share, angle, seed):
    """Add errors to the boxes of a film: new in each image, and as a share of the side repeated.

    The correlation of the second is exp(-d / angle) between views that are d apart, in radians of
    direction and logarithm of distance; the camera sees every thing from where it is.
    """
    random = np.random.default_rng(seed)
    detections = made.recording.detections
    box = detections.box.copy()
    for number, thing in enumerate(made.things):
        rows = np.flatnonzero(made.thing == number)
        ray = made.poses[detections.pose[rows], :3] - thing.center
        distance = np.sqrt((ray**2).sum(axis=1))
        cosine = np.clip((ray @ ray.T) / np.outer(distance, distance), -1.0, 1.0)
        nearer = np.log(np.divide.outer(distance, distance))
        alike = np.exp(-np.sqrt(np.arccos(cosine) ** 2 + nearer**2) / angle)
        lower = np.linalg.cholesky(alike + 1e-9 * np.eye(len(rows)))
        drawn = lower @ random.normal(size=(len(rows), 4))
        side = np.tile(box[rows, 2:] - box[rows, :2], (1, 2))
        box[rows] += repeated_share * side * drawn + random.normal(0.0, new_px, (len(rows), 4))
    recording = replace(made.recording, detections=replace(detections, box=box))
    return replace(made, recording=recording)
