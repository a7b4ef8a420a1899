"""Some seconds of each fuzzer, with cases that are always the same; `./run fuzz` runs more."""

import random

import pytest
from fuzz.harness import Harness, targets
from fuzz.mutate import mutate

from dqslam.io.convert import FORMATS

CASES = {"reader": 600, "binding": 600, "session": 12}


@pytest.mark.parametrize("kind", CASES)
def test_nothing_fails(kind):
    said = []
    with targets(kind) as found:
        harness = Harness(found, "tests", memory_gb=8.0)
        failures = harness.run(120.0, said.append, CASES[kind])
    assert failures == 0, "\n".join(said)
    assert harness.done == CASES[kind], "too slow"


def test_every_format_is_fuzzed():
    with targets("reader") as found:
        for kind, formats in FORMATS.items():
            for one in formats:
                assert (f"reader {kind}/{one.name}" in found) == (one.write is not None)
                foreign = [name for name in found if name.startswith(f"reader {kind}/{one.name}/")]
                assert foreign or one.write is not None or one.name == "rosbag"


def test_failures_are_told_with_what_repeats_them():
    def fails(seed):
        if seed.endswith("3"):
            raise KeyError("three")
        if seed.endswith("5"):
            raise SystemExit(9)

    said = []
    harness = Harness({"one": fails}, "7", memory_gb=0.0)
    assert harness.run(30.0, said.append, 8) == 2
    assert harness.done == 8
    assert said[0].startswith("FAILED one@7:3: KeyError in test_fuzz.py line ")
    assert said[0].endswith("./run fuzz --repeat 'one@7:3'")
    assert said[1].startswith("FAILED one@7:5: ends the process (")


def test_the_same_seed_mutates_alike():
    content = b"1.0 2.0 3.0\n4.0 5.0 6.0\n"
    results = {mutate(content, random.Random(seed)) for seed in range(100)}
    assert len(results) > 80
    for seed in range(20):
        again = mutate(content, random.Random(seed))
        assert again == mutate(content, random.Random(seed))
