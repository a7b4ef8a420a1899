"""How much evidence wrong motions have without a reason."""

import numpy as np
import pytest

from dqslam.places.alignment.judge import CHANCE, RIVAL, Hypothesis, doubt, lead, tail_of
from dqslam.places.alignment.rigid import Motions

# Of twelve runners-up of one class: the six best are 2, 4, 6, 8, 10 and 12.
RUNNERS_UP = np.array([12.0, 10.0, 8.0, 6.0, 4.0, 2.0, 1.0, 0.0, 0.0, -1.0, -1.0, -2.0])


def hypothesis(evidence, by_class, pairs=5):
    """Return a motion with some evidence."""
    motion = Motions(np.eye(3)[None], np.zeros((1, 3)), np.ones(1))
    return Hypothesis(
        motion,
        np.arange(pairs),
        np.ones(pairs),
        np.ones(pairs),
        0.1,
        evidence,
        np.atleast_1d(by_class),
    )


def test_the_tail_is_the_mean_excess_over_the_last_of_the_better_half():
    tail = tail_of(RUNNERS_UP[:, None], np.ones(12, dtype=bool))
    # 10, 8, 6, 4 and 2 above the sixth
    assert tail == pytest.approx([6.0])


def test_each_class_has_a_tail_and_chance_alone_is_the_least():
    both = np.column_stack([RUNNERS_UP, 0.01 * RUNNERS_UP[::-1]])
    assert tail_of(both, np.ones(12, dtype=bool)) == pytest.approx([6.0, 1.0])
    assert tail_of(both[:7], np.ones(7, dtype=bool)) == pytest.approx([1.0, 1.0])


def test_motions_that_chance_explains_better_have_no_tail():
    possible = np.zeros(12, dtype=bool)
    assert tail_of(RUNNERS_UP[:, None], possible) == pytest.approx([1.0])
    possible[0] = True  # the first alone: 10 of the five that were counted
    assert tail_of(RUNNERS_UP[:, None], possible) == pytest.approx([2.0])


def test_a_lead_is_shorter_where_wrong_motions_are_possible():
    """The same parts by class, with evidences on either side of what chance excludes."""
    best = hypothesis(20.0, 30.0)
    below = [hypothesis(-CHANCE - 0.1, one) for one in RUNNERS_UP]
    above = [hypothesis(-CHANCE + 0.1, one) for one in RUNNERS_UP]
    assert lead([best, *below]) == pytest.approx(18.0)
    assert lead([best, *above]) == pytest.approx(18.0 / 6.0)
    assert lead([best]) == np.inf
    assert 18.0 / 6.0 < RIVAL < 18.0
    assert doubt([best, *below]) == ""
    assert "another motion explains the maps nearly as well" in doubt([best, *above])
