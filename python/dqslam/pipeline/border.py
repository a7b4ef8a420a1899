"""Edges of boxes that the border of the image cut."""

from __future__ import annotations

from dataclasses import replace

from dqslam.lens import cut_edges
from dqslam.recording import Recording


def with_cut_edges(recording: Recording) -> Recording:
    """Flag the edges of boxes that lie on the border of the image: the object may go on beyond."""
    detections = recording.detections
    truncated = detections.truncated | cut_edges(recording.camera, detections.box)
    return replace(recording, detections=replace(detections, truncated=truncated))
