"""What a drawing process does: one job, as JSON on its command line."""

import json
import sys

from chamberopt.common.errors import InputError
from chamberopt.output.viewer import window
from chamberopt.output.viewer.images import coverage, difference, part, replay_film

DRAWERS = {
    "coverage": coverage.draw,
    "difference": difference.draw,
    "inspect": window.draw,
    "part": part.draw,
    "replay": replay_film.draw,
}

if __name__ == "__main__":
    job = json.loads(sys.argv[1])
    try:
        DRAWERS[job["draw"]](job)
    except InputError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
