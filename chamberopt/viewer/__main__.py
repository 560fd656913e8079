"""What a drawing process does: one job, as JSON on its command line."""

import json
import sys

from chamberopt.errors import InputError
from chamberopt.viewer import difference, replay, side_by_side, two_sides, window

DRAWERS = {
    "coverage": side_by_side.draw,
    "difference": difference.draw,
    "inspect": window.draw,
    "part": two_sides.draw,
    "replay": replay.draw,
}

if __name__ == "__main__":
    job = json.loads(sys.argv[1])
    try:
        DRAWERS[job["draw"]](job)
    except InputError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
