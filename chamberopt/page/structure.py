"""Change the chamber's shape, or the kind of holder, of the design that a page edits.

Each shape and each kind has keys of its own, which a change takes out or puts in.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from chamberopt.chamber.part import preview_part
from chamberopt.chamber.propose.proposed_target import SHAPES, propose_sizes
from chamberopt.common.errors import InputError
from chamberopt.design import shapes
from chamberopt.design.design import Design
from chamberopt.design.fixture import HOLDER_KEYS, Holder
from chamberopt.design.shapes import ParametricChamber

SHAPE, KIND, NO_HOLDER = "chamber.shape", "holder.kind", ""
# Keys of a chamber that stay, with their values, when its shape changes; and those of its shapes.
STAY = {*ParametricChamber.model_fields} - {"shape"}
OF_SHAPES = {key for name in SHAPES for key in shapes.SHAPES[name].model_fields} - STAY - {"shape"}


def structure_choices(design: Design) -> dict[str, tuple[str, ...]]:
    """Return the shapes and the kinds of holder that a page may give a design, by dotted name.

    A drawn set-up has its own, and each of several steps may. An own shape stays. An arbor needs
    the walls of a hole, and is there only if the design has chosen faces for its holder.
    """
    if design.chamber.setup() is not None or design.steps is not None:
        return {}
    has_faces = design.holder is not None and design.holder.at is not None
    kinds = (kind for kind in HOLDER_KEYS if kind != "arbor" or has_faces)
    of_chamber = {SHAPE: SHAPES} if design.chamber.shape in SHAPES else {}
    return {**of_chamber, KIND: (NO_HOLDER, *kinds)}


def may_change(design: Design, name: str, value: object) -> bool:
    """Return True if a page may give a key of the shape or holder of a design this value."""
    choices, (table, _, key) = structure_choices(design), name.partition(".")
    if name in (SHAPE, KIND):
        return value in choices.get(name, ())
    if table == "holder" and KIND in choices:
        first = key.partition(".")[0]
        return first in Holder.model_fields and (first != "at" or value is None)
    return table == "chamber" and SHAPE in choices and key in OF_SHAPES


def restructured(
    design: Design,
    changes: Mapping[str, Any],
    name: str,
    wanted: str,
    changed: Callable[[Mapping[str, Any]], Design],
) -> dict[str, Any]:
    """Return changes after which a design has another shape or kind of holder.

    The chamber's plan gets the sizes that `new` proposes for the pose; its height and the part's
    place stay. Of a holder the faces and the axis stay. What the design file itself has is taken
    as it stands there.

    Args:
        design: the design as its file has it.
        changes: new values by dotted name until now.
        name: SHAPE or KIND.
        wanted: the shape, or the kind.
        changed: returns the design with some values changed.

    Raises:
        InputError: the page does not offer this, or the changes until now make no valid design.
    """
    allowed = structure_choices(design).get(name, ())
    if wanted not in allowed:
        raise InputError(f"{name}: given {wanted}; allowed: {', '.join(allowed) or 'no change'}")
    if name == KIND:
        return _with_kind(design.holder, changes, wanted)
    kept = {
        one: value
        for one, value in changes.items()
        if one != SHAPE and one.removeprefix("chamber.") not in OF_SHAPES
    }
    if wanted == design.chamber.shape:
        return kept
    old = {f"chamber.{key}": None for key in design.chamber.model_fields_set & OF_SHAPES}
    new = {f"chamber.{key}": size for key, size in _plan(changed(kept), wanted).items()}
    return {**kept, SHAPE: wanted, **old, **new}


def _with_kind(holder: Holder | None, changes: Mapping[str, Any], kind: str) -> dict[str, Any]:
    kept = {name: value for name, value in changes.items() if not name.startswith("holder.")}
    if kind == (NO_HOLDER if holder is None else holder.kind):
        return kept
    given = set() if holder is None or kind == NO_HOLDER else holder.model_fields_set
    stay = {"kind", "axis", *({"at"} & {*HOLDER_KEYS.get(kind, ())})}
    return {**kept, KIND: kind, **{f"holder.{key}": None for key in given - stay}}


def _plan(design: Design, shape: str) -> dict[str, float | str]:
    """Return the keys of the form in plan that `new` proposes for the pose of a design's part.

    Where the part goes out through the side walls now, it is the form round the target alone.
    """
    part = preview_part(design)
    walls = design.chamber.surface(part.vertices, part.mesh.triangles).vertices
    below = part.vertices[part.vertices[:, 2] < walls[:, 2].max(), :2]
    is_within = (below >= walls[:, :2].min(axis=0)) & (below <= walls[:, :2].max(axis=0))
    # The part may stand beside the chamber's axis: with its mirror image, the axis is the middle.
    points = part.vertices - [0.0, 0.0, part.vertices[:, 2].min()]
    both = np.concatenate([points, points * [-1.0, -1.0, 1.0]])
    corners = np.unique(part.mesh.triangles[part.target])
    target = both[np.r_[corners, corners + len(points)]]
    return propose_sizes(
        both,
        float(target[:, 2].max()),
        max(design.shot.diameters),
        shape,
        target=None if is_within.all() else target,
    ).plan
