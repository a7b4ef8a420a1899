"""What several test modules start from."""

import pytest

from orbit import make_orbit, write_orbit


@pytest.fixture(scope="session")
def orbit():
    """Return the truth of a small recording; boxes have a pixel of noise."""
    return make_orbit(noise_px=1.0)


@pytest.fixture
def files(tmp_path, orbit):
    """Write it, and return camera, trajectory and boxes; a module may have files of its own."""
    return write_orbit(tmp_path, orbit)
