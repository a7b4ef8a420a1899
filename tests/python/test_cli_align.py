"""``dqslam align``: files, exit codes and what is printed."""

import json

import numpy as np
import pytest

from dqslam.cli import main
from planted_maps import motion, two_maps, write_csv

B_FROM_A = motion(1.0, (5.0, 6.0, 0.0))


@pytest.fixture
def maps(tmp_path):
    a, b = two_maps(0, shared=12, others=6, sigma=0.03, b_from_a=B_FROM_A)
    return str(write_csv(tmp_path / "a.csv", a)), str(write_csv(tmp_path / "b.csv", b))


def test_the_file_has_the_motion_and_its_pairs(tmp_path, maps, capsys):
    out = tmp_path / "out"
    assert main(["align", *maps, "--out", str(out), "--json"]) == 0
    content = json.loads((out / "alignment.json").read_text())
    assert json.loads(capsys.readouterr().out) == content
    np.testing.assert_allclose(content["b_from_a"], B_FROM_A, atol=0.2)
    assert np.shape(content["covariance"]) == (6, 6)
    assert {(0, 17), (11, 6)} <= {(pair["a"], pair["b"]) for pair in content["pairs"]}
    assert content["runner_up"]["evidence"] < content["evidence"]
    assert content["assumptions"][0] == "z is up in both maps"
    assert (out / "config.toml").exists()


def test_where_it_cannot_tell_it_exits_with_3_and_writes_nothing(tmp_path, maps, capsys):
    other = two_maps(5, shared=0, others=18, sigma=0.0, b_from_a=B_FROM_A)[1]
    unrelated = write_csv(tmp_path / "other.csv", other)
    out = tmp_path / "out"
    assert main(["align", maps[0], str(unrelated), "--out", str(out)]) == 3
    assert "cannot tell whether" in capsys.readouterr().err
    assert not out.exists()


def test_a_wrong_file_exits_with_2(tmp_path, maps, capsys):
    (tmp_path / "bad.csv").write_text("class_id,x,y,z\n1,2,3\n")
    assert main(["align", maps[0], str(tmp_path / "bad.csv")]) == 2
    assert "bad.csv:2: 3 fields, but 4 columns" in capsys.readouterr().err
