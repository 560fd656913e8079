"""Turned parts of any size and number of facets, along z from 0."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from manifold3d import CrossSection, Manifold

IN_FILLET = 8  # facets of a quarter of a circle


def stepped_shaft(steps: Sequence[tuple[float, float]], fillet: float, sides: int = 96) -> Manifold:
    """A shaft in steps, with fillets where it grows wider or narrower.

    Args:
        steps: radius and length of each [mm].
        fillet: radius of the fillets [mm].
        sides: facets around it.
    """
    outline, ends = [(0.0, 0.0), (steps[0][0], 0.0)], np.cumsum([long for _, long in steps])
    angles = np.linspace(0.0, 0.5 * np.pi, IN_FILLET + 1)
    for end, (here, _), (there, _) in zip(ends, steps, steps[1:], strict=False):
        away = fillet * np.column_stack([1.0 - np.cos(angles), np.sin(angles) - 1.0])
        if there > here:
            outline += [(here + r, end + z) for r, z in away]
            outline.append((there, end))
        else:
            outline.append((here, end))
            outline += [(there + r, end - z) for r, z in away[::-1]]
    outline += [(steps[-1][0], ends[-1]), (0.0, ends[-1])]
    return CrossSection([np.array(outline)]).revolve(sides)
