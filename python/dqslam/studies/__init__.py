"""Studies: the paper's experiment, sweeps, ablations, and the pool of workers that runs them."""

TYPE_CHECKING = False

if TYPE_CHECKING:  # imported when they are asked for, see the package's own list
    from dqslam.studies import ablation as ablation
    from dqslam.studies import batch as batch
    from dqslam.studies import degeneracy as degeneracy
    from dqslam.studies import paper as paper
    from dqslam.studies import pool as pool
    from dqslam.studies import sweep as sweep
else:
    from dqslam._lazy import lazy_exports

    __getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
