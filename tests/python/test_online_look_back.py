"""How far back a session looks: what that costs, and what is saved for it."""

from types import SimpleNamespace

import numpy as np

from dqslam.online import look_back
from dqslam.online.look_back import LookBackBudget


def test_a_look_far_back_is_paid_from_savings():
    """Windows of 40 keyframes, one earned at each: 100 keyframes back cost two and a half."""
    budget = LookBackBudget()
    for _ in range(3):
        assert budget.next_window(161) == 120
    assert budget._spend([40, 60], 120, last=160) == 40
    assert budget._spend([60], 120, last=160) == 120  # nothing is left
    budget.next_window(161)
    budget.next_window(161)
    assert budget._spend([60, 100], 120, last=160) == 100
    assert budget._spend([], 120, last=160) == 120


def test_savings_for_looks_far_back_are_limited():
    """At most four looks at the whole path: 160 of 160 keyframes cost four windows."""
    budget = LookBackBudget()
    for _ in range(1000):
        budget.next_window(160)
    looks = [budget._spend([0], 120, last=160) for _ in range(6)]
    assert looks == [0, 0, 0, 0, 120, 120]


def test_duplicates_that_savings_do_not_reach_are_asked_again(monkeypatch):
    monkeypatch.setattr(look_back, "close_pairs", lambda scene: [(0, 1)])
    seen = {0: np.arange(8), 1: np.arange(150, 160)}
    store = SimpleNamespace(keyframes=range(161), keyframes_of=seen.get)
    labels = SimpleNamespace(shown_objects=np.array([1]))
    local = SimpleNamespace(scene=SimpleNamespace(labels=labels), begin=120)
    budget = LookBackBudget()
    assert budget.for_duplicates(local, store) == 120
    for _ in range(4):
        budget.next_window(161)
    assert budget.for_duplicates(local, store) == 0
    assert budget.for_duplicates(local, store) == 120  # asked, with as many boxes
