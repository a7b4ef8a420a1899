"""Where the real recordings are: in $DQSLAM_REALDATA, else beside the repository."""

import os
from pathlib import Path

import pytest

BESIDE = Path(__file__).parents[3] / "shared" / "realdata"


def recording(name: str) -> Path:
    """Return the folder of a real recording; skip the test where there is none."""
    folder = Path(os.environ.get("DQSLAM_REALDATA", BESIDE)) / name
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder} (set DQSLAM_REALDATA)")
    return folder
