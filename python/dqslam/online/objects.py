"""The objects of a session: ids, classes and size priors of the core's rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dqslam._checks import Floats, Ints
from dqslam.assumptions import SizePrior, SizePriors


@dataclass(frozen=True, eq=False)
class Objects:
    """The map as it stands."""

    ids: Ints
    """In the order in which they were seen first, shape (o,)."""
    class_names: tuple[str, ...]
    """One per object: the class most of its boxes have."""
    ellipsoids: Floats
    """Center and log-Cholesky shape, shape (o, 9)."""
    observations: Ints
    """Boxes per object in this session, shape (o,)."""

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.ids)

    @property
    def centers(self) -> Floats:
        """In the world, meters, shape (o, 3)."""
        return self.ellipsoids[:, :3]


class Registry:
    """Which row of the core an id has, and what is known of it beside its place."""

    def __init__(self, size_prior: SizePrior | SizePriors | None) -> None:
        """Begin without objects."""
        self.ids: list[int] = []
        self.votes: list[Counter[str]] = []
        self.priors: list[SizePrior] = []
        self._row: dict[int, int] = {}
        self.size_prior = SizePrior() if size_prior is None else size_prior

    def __contains__(self, number: int) -> bool:
        """Tell whether an object has this id."""
        return number in self._row

    def row_of(self, number: int) -> int:
        """Return the row of an id."""
        return self._row[number]

    def next_id(self) -> int:
        """Return an id that no object has."""
        return max(self.ids, default=-1) + 1

    def rows(
        self, ids: Sequence[int], names: Sequence[str]
    ) -> tuple[list[int], list[tuple[int, SizePrior]]]:
        """Return the rows of ids, and the id and prior of those that are new; registers nothing."""
        rows: list[int] = []
        new: list[tuple[int, SizePrior]] = []
        found: dict[int, int] = {}
        for number, name in zip(ids, names, strict=True):
            row = self._row.get(number)
            if row is None:
                row = found.get(number)
            if row is None:
                row = found[number] = len(self.ids) + len(new)
                new.append((number, self.prior_of(name)))
            rows.append(row)
        return rows, new

    def prior_of(self, name: str) -> SizePrior:
        """Return the size prior of a class."""
        given = self.size_prior
        return given.of(name) if isinstance(given, SizePriors) else given

    def register(self, new: Sequence[tuple[int, SizePrior]]) -> None:
        """Take new objects in."""
        for number, prior in new:
            self._row[number] = len(self.ids)
            self.ids.append(number)
            self.votes.append(Counter())
            self.priors.append(prior)

    def take(
        self, votes: Mapping[int, Counter[str]], ids: Sequence[int], priors: Sequence[SizePrior]
    ) -> None:
        """Take over how often objects were called what, by row.

        New ones have ids, -1 where any will do, and size priors.
        """
        for number, prior in zip(ids, priors, strict=True):
            self.register([(number if number >= 0 else self.next_id(), prior)])
        for row, counts in votes.items():
            self.votes[row] = counts

    def class_names(self) -> tuple[str, ...]:
        """Return the class of each object: the one most of its boxes have."""
        return tuple(votes.most_common(1)[0][0] if votes else "object" for votes in self.votes)
