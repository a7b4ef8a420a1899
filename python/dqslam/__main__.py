"""``python -m dqslam``: the command line, where the program itself is not on the path."""

import sys

from dqslam.cli import main

if __name__ == "__main__":
    sys.exit(main())
