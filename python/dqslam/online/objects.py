"""The objects of a session for users, and the ids of the session's rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam._ids import ObjectId, ObjectRow


@dataclass(frozen=True, eq=False)
class Objects:
    """The objects of a session, as estimated now."""

    object_ids: Ints
    """Ids in the order in which objects were first observed, shape (o,)."""
    class_names: tuple[str, ...]
    """The class of most boxes of each object."""
    observations: Ints
    """Number of boxes of each object in this session, shape (o,)."""
    ellipsoids: Floats
    """Center and log-Cholesky shape, shape (o, 9)."""

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.object_ids)

    @property
    def centers(self) -> Floats:
        """Centers in the world, meters, shape (o, 3)."""
        return self.ellipsoids[:, :3]

    @property
    def dual_quadrics(self) -> Floats:
        """q1 .. q9 with Q*(4,4) = 1, shape (o, 9)."""
        quadrics = [_core.dual_quadric_from_ellipsoid(one) for one in self.ellipsoids]
        return np.array(quadrics).reshape(-1, 9)


ANY_ID = ObjectId(-1)
"""Replaced by an id that no object has."""


class Registry:
    """Ids of the session's objects by row, and the classes of their boxes with final ids."""

    def __init__(self, ids: Iterable[ObjectId] = ()) -> None:
        """Begin with some objects."""
        self.ids: list[ObjectId] = []
        self.row_of: dict[ObjectId, ObjectRow] = {}
        self.votes: list[Counter[str]] = []
        """Numbers of an object's boxes with final ids by class, by row of the object."""
        self.register(ids)

    def rows_of(self, ids: Sequence[ObjectId]) -> tuple[list[ObjectRow], list[int]]:
        """Return the rows of ids, and the first places in ``ids`` of new ids.

        New ids must be registered in this order.
        """
        new: dict[ObjectId, ObjectRow] = {}
        first = []
        for place, one in enumerate(ids):
            if one not in self.row_of and one not in new:
                new[one] = ObjectRow(len(self.ids) + len(new))
                first.append(place)
        return [self.row_of[one] if one in self.row_of else new[one] for one in ids], first

    def register(self, ids: Iterable[ObjectId]) -> None:
        """Add objects by their ids. One whose id another has already gets a free one."""
        for one in ids:
            is_free = one != ANY_ID and one not in self.row_of
            name = one if is_free else self._free_id()
            self.row_of[name] = ObjectRow(len(self.ids))
            self.ids.append(name)
            self.votes.append(Counter())

    def release(self, one: ObjectId) -> None:
        """Give the object with an id another one, so that the id is free."""
        row = self.row_of.pop(one)
        self.ids[row] = self._free_id()
        self.row_of[self.ids[row]] = row

    def _free_id(self) -> ObjectId:
        return ObjectId(max(self.ids, default=-1) + 1)
