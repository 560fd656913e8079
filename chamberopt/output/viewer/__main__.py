"""The drawing process: draws the one picture that its command line describes as JSON."""

import json
import sys

from chamberopt.common.errors import InputError
from chamberopt.output.viewer.images.coverage import render_coverage
from chamberopt.output.viewer.images.dents import render_dents
from chamberopt.output.viewer.images.difference import render_difference
from chamberopt.output.viewer.images.part import render_part
from chamberopt.output.viewer.images.replay_film import render_replay
from chamberopt.output.viewer.window import render_inspect

RENDERERS = {
    "coverage": render_coverage,
    "dents": render_dents,
    "difference": render_difference,
    "inspect": render_inspect,
    "part": render_part,
    "replay": render_replay,
}

if __name__ == "__main__":
    job = json.loads(sys.argv[1])
    try:
        RENDERERS[job["draw"]](job)
    except InputError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
