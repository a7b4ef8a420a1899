"""Studies: the paper's experiment, sweeps, ablations, and the pool of workers that runs them."""
