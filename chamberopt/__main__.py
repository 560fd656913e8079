"""Makes `python -m chamberopt` the same as `chamberopt`."""

import sys

from chamberopt.cli import main

if __name__ == "__main__":
    sys.exit(main())
