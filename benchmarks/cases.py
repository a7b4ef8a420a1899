"""The cases by name."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from benchmarks.problems import Problem, chain, paper


@dataclass(frozen=True)
class Case:
    """A problem of some size."""

    make: Callable[[int, float], Problem]
    """From a seed and a factor on the noise of odometry."""
    noise: float
    """That factor, unless another is asked for: drift grows with the length of the drive."""

    programs: tuple[str, ...] = ("dqslam", "gtsam_quadrics")
    """What can solve it."""

    def problem(self, seed: int, noise: float | None = None) -> Problem:
        """Make the problem."""
        return self.make(seed, self.noise if noise is None else noise)


ALL_PROGRAMS = ("dqslam", "gtsam_quadrics", "scipy")
ONLINE = "dqslam_online"
"""Step by step, then polished."""
CASES = {
    "paper": Case(paper, noise=1.0, programs=ALL_PROGRAMS),
    "peer-1": Case(partial(chain, 1, 10), noise=1.0, programs=ALL_PROGRAMS),
    "peer-9": Case(partial(chain, 9, 11), noise=0.1),
    "peer-84": Case(partial(chain, 84, 12), noise=0.02),
    "online-5k": Case(partial(chain, 9, 11), noise=0.1, programs=("dqslam", ONLINE)),
    "million": Case(partial(chain, 356, 12), noise=0.01),
}
LINEARIZE = "linearize"
DEFAULT_CASES = ("paper", "peer-1", "peer-9", LINEARIZE)
