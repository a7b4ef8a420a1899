"""Types of integers with different meanings, which the type checker distinguishes.

Arrays of them are arrays of integers with names like ``object_rows`` and ``object_ids``.
"""

from typing import NewType

ObjectId = NewType("ObjectId", int)
"""Id of an object in files, in the public interface, or of a tracker."""
ObjectRow = NewType("ObjectRow", int)
"""Row of an object in a map or a session, which never changes."""
ObservationRow = NewType("ObservationRow", int)
"""Row of a box in a recording or a session, in the order of arrival."""
Tracklet = NewType("Tracklet", int)
"""Number of a tracklet, from 0 on. A tracklet has boxes that were linked between images."""
