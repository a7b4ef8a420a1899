"""Fuzz for some minutes: `./run fuzz [MINUTES]`; each failure is printed with what repeats it."""

import argparse
import sys
import time

from fuzz.harness import Harness, targets


def main() -> int:
    parser = argparse.ArgumentParser(prog="./run fuzz", description=__doc__)
    parser.add_argument("minutes", nargs="?", type=float, default=1.0)
    parser.add_argument("--seed", default=str(int(time.time())), help="default: the time")
    parser.add_argument("--target", default="", help="only targets whose names begin like this")
    parser.add_argument("--repeat", metavar="CASE", help="one case, with its traceback")
    parser.add_argument("--memory-gb", type=float, default=8.0, help="0 for no limit")
    asked = parser.parse_args()
    with targets(asked.target) as found:
        if asked.repeat is not None:
            name, _, _ = asked.repeat.partition("@")
            found[name](asked.repeat)
            print("no failure")
            return 0
        harness = Harness(found, asked.seed, memory_gb=asked.memory_gb)
        failures = harness.run(60.0 * asked.minutes, say=lambda text: print(text, flush=True))
    print(f"{harness.done} cases of {len(found)} targets, seed {asked.seed}: {failures} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
