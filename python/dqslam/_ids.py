"""Whole numbers that stand for different things; the type checker keeps them apart.

Arrays of them stay arrays of integers, named after what they hold: ``object_rows``, ``object_ids``.
"""

from typing import NewType

ObjectId = NewType("ObjectId", int)
"""What an object is called outside: by a tracker, in files, in the public interface."""
ObjectRow = NewType("ObjectRow", int)
"""Row of an object in a map or a session; it keeps it for good."""
ObservationRow = NewType("ObservationRow", int)
"""Row of a box in a recording or a session, in the order in which they arrived."""
Tracklet = NewType("Tracklet", int)
"""Number of a tracklet, from 0 on: boxes that were linked from image to image."""
