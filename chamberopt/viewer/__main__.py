"""The drawing process: draws the one picture that its command line describes as JSON."""

import json
import os
import sys
import threading

from chamberopt.common.errors import InputError
from chamberopt.pictures.coverage import render_coverage
from chamberopt.pictures.dents import render_dents
from chamberopt.pictures.difference import render_difference
from chamberopt.pictures.film import render_replay
from chamberopt.pictures.part import render_part
from chamberopt.viewer.window import render_inspect

RENDERERS = {
    "coverage": render_coverage,
    "dents": render_dents,
    "difference": render_difference,
    "inspect": render_inspect,
    "part": render_part,
    "replay": render_replay,
}


def _end_with_the_command() -> None:
    """End this process when the command that started it has ended and its pipe is closed."""
    os.read(0, 1)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_with_the_command, daemon=True).start()
    job = json.loads(sys.argv[1])
    try:
        RENDERERS[job["draw"]](job)
    except InputError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
