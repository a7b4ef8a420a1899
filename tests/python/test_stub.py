"""The committed type stub is the one that the built extension gives."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def test_stub_is_up_to_date(tmp_path: Path) -> None:
    pytest.importorskip("pybind11_stubgen", reason="pybind11-stubgen is not installed")
    fresh = tmp_path / "_core.pyi"
    subprocess.run([sys.executable, ROOT / ".ci/stub.py", fresh], check=True)
    committed = ROOT / "python/dqslam/_core.pyi"
    assert committed.read_text() == fresh.read_text(), "./run stub writes it again"
