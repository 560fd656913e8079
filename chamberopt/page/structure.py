"""Change shape, kind of holder or mask, or the number of steps of an edited design.

Each shape and each kind has keys of its own, which a change takes out or puts in.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from chamberopt.chamber.layout.sizes import SHAPES, propose_sizes
from chamberopt.chamber.part import chosen_triangles, preview_part
from chamberopt.common.errors import InputError
from chamberopt.design import shapes
from chamberopt.design.design import Design
from chamberopt.design.fixture import HOLDER_KEYS, Holder
from chamberopt.design.process import LONGEST_NAME
from chamberopt.design.shapes import ParametricChamber
from chamberopt.geometry.triangles import area_vectors

SHAPE, KIND, NO_HOLDER = "chamber.shape", "holder.kind", ""
# Kinds of masks by the keys of the file that make them; the file has no key for the kind.
MASK_KIND, NO_MASK = "mask.kind", ""
MASK_KINDS: dict[str, dict[str, Any]] = {
    "shell": {},
    "plugs": {"plugs": True},
    "block": {},  # with an axis, which the way of its faces gives
}
# Keys that a mask may have beside its faces.
OF_MASK = ("axis", "plugs", "thickness_mm", "margin_mm")
STEP = re.compile(r"steps\.(\d+)(?=\.|$)")
KEPT = "steps"  # numbers of the file's steps that stay; further keys count those that are left
FIRST = "first"  # name of the step that the design without steps becomes
# Tables whose keys a step may change on the page, and those that a further step is given.
OF_STEP: dict[str, tuple[str, ...]] = {
    "part": (),
    "chamber": (),
    "sonotrode": ("amplitude_um", "amplitude_pv_um"),
    "shot": ("mass_g", "diameter_mm"),
}
# Keys of a chamber that stay, with their values, when its shape changes; and those of its shapes.
STAY = {*ParametricChamber.model_fields} - {"shape"}
OF_SHAPES = {key for name in SHAPES for key in shapes.SHAPES[name].model_fields} - STAY - {"shape"}


def structure_choices(design: Design) -> dict[str, tuple[str, ...]]:
    """Return the shapes and the kinds of holder and mask that a page may give a design.

    They are by dotted name. A drawn set-up has its own, and each of several steps may. An own shape
    stays. An arbor needs the walls of a hole, and is there only if the design has chosen faces for
    its holder. A mask begins with its first face.
    """
    if design.chamber.setup() is not None or design.steps is not None:
        return {}
    has_faces = design.holder is not None and design.holder.at is not None
    kinds = (kind for kind in HOLDER_KEYS if kind != "arbor" or has_faces)
    of_chamber = {SHAPE: SHAPES} if design.chamber.shape in SHAPES else {}
    of_mask = {MASK_KIND: (NO_MASK, *MASK_KINDS)} if design.mask is not None else {}
    return {**of_chamber, KIND: (NO_HOLDER, *kinds), **of_mask}


def mask_kind(design: Design) -> str:
    """Return which of MASK_KINDS a design's mask is, or NO_MASK."""
    if design.mask is None:
        return NO_MASK
    return "plugs" if design.mask.plugs else "shell" if design.mask.axis is None else "block"


def picked_surfaces(design: Design) -> dict[str, str]:
    """Return in words what clicks on faces choose in a design, by the dotted name of its table.

    A drawn set-up has its own holder and mask, each of several steps may, and a part that turns has
    no mask.
    """
    found = {"part.target": "the target"}
    found |= {f"zones.{k}.target": f"zone {zone.name}" for k, zone in enumerate(design.zones)}
    if design.chamber.setup() is not None or design.steps is not None:
        return found
    if design.holder is not None and "at" in HOLDER_KEYS[design.holder.kind]:
        found["holder.at"] = "what the holder clamps"
    if design.effects.part_turn is None:
        found["mask.at"] = "what a mask covers"
    return found


def may_change(design: Design, name: str, value: object) -> bool:
    """Return True if a page may give a key of shape, holder, mask or an added step this value."""
    if found := STEP.match(name):
        inner = name[found.end() :]
        is_added = int(found[1]) >= len(design.steps or ())
        return is_added and (_is_number(value) if inner else _is_step(value))
    choices, (table, _, key) = structure_choices(design), name.partition(".")
    if name in (SHAPE, KIND):
        return value in choices.get(name, ())
    if table == "mask" and KIND in choices:
        if name == MASK_KIND:
            return value in (NO_MASK, *MASK_KINDS)
        return key.partition(".")[0] in OF_MASK
    if table == "holder" and KIND in choices:
        first = key.partition(".")[0]
        return first in Holder.model_fields and (first != "at" or value is None)
    return table == "chamber" and SHAPE in choices and key in OF_SHAPES


def with_added_step(
    design: Design, changes: Mapping[str, Any], name: str, copied: int
) -> dict[str, Any]:
    """Return changes after which a design has a further step, which is a copy of one of its steps.

    A design without steps gets two, and the first is as the design is. In the copy the pose, the
    charge and the amplitude are given, as these differ from step to step.

    Args:
        design: the design with its changes until now.
        changes: new values by dotted name until now.
        name: name of the further step, in words.
        copied: number of the step that is copied.

    Raises:
        InputError: the step has a holder, a mask or further sonotrodes of its own, or its name is
            that of another one.
    """
    letters = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    name = re.sub(r"\W+", "_", letters).strip("_")
    name = (name if name[:1].isalpha() else f"step_{name}")[:LONGEST_NAME]
    if name in (FIRST, *(one.name for one in design.steps or ())):
        raise InputError(f"name of the step: there is a step {name}; give another name")
    steps, each = design.steps or (), [*design.in_steps.values()]
    if not 0 <= copied < len(each):
        raise InputError(f"step: given {copied}; allowed: from 0 to {len(each) - 1}")
    own = steps[copied].changes if steps else {}
    if whole := [table for table in own if table not in OF_STEP]:
        text = f"step {steps[copied].name} has {' and '.join(whole)} of its own"
        raise InputError(f"{text}: copy it in the file, or copy another step")
    values = each[copied].model_dump(exclude_none=True)
    given = {
        table: {key: values[table][key] for key in keys if key in values[table]}
        for table, keys in OF_STEP.items()
    }
    given["part"] = {"rotate_deg": [*values["part"]["rotate_deg"]]}
    tables = {table: {**own.get(table, {}), **given[table]} for table in OF_STEP}
    share = steps[copied].time_share if steps else 1.0
    added = {"name": name, "time_share": share} | {key: one for key, one in tables.items() if one}
    first = {} if steps else {"steps.0": {"name": FIRST}}
    return {**changes, **first, f"steps.{max(len(steps), 1)}": added}


def without_step(
    of_file: Design, changes: Mapping[str, Any], count: int, removed: int
) -> dict[str, Any]:
    """Return changes after which a design lacks one of its steps; the first alone is as no steps.

    Args:
        of_file: the design as its file has it.
        changes: new values by dotted name until now.
        count: number of steps with these changes.
        removed: number of the step. The first is the design itself, and stays.
    """
    if not 0 < removed < count:
        raise InputError(f"step: given {removed}; allowed: from 1 to {count - 1}")
    kept = changes.get(KEPT, [*range(len(of_file.steps or ()))])
    made = {KEPT: [] if count == 2 else [*kept[:removed], *kept[removed + 1 :]]}
    for name, value in changes.items():
        found = STEP.match(name)
        if found is None and name != KEPT:
            made[name] = value
        elif found is not None and count > 2 and (number := int(found[1])) != removed:
            made[f"steps.{number - (number > removed)}{name[found.end() :]}"] = value
    if not of_file.steps:
        del made[KEPT]
    return made


def _is_number(value: object) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def _is_step(value: object) -> bool:
    """Return True for the keys of a step if they hold numbers, and a shape that needs no file."""
    if not isinstance(value, Mapping):
        return False
    tables = {key: one for key, one in value.items() if key not in ("name", "time_share")}
    leaves = (
        (key, one)
        for table in tables.values()
        if isinstance(table, Mapping)
        for key, held in table.items()
        for one in (held if isinstance(held, list | tuple) else [held])
    )
    return tables.keys() <= OF_STEP.keys() and all(
        one in SHAPES if key == "shape" else _is_number(one) for key, one in leaves
    )


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
        name: SHAPE, KIND or MASK_KIND.
        wanted: the shape, or the kind.
        changed: returns the design with some values changed.

    Raises:
        InputError: the page does not offer this, or the changes until now make no valid design.
    """
    allowed = structure_choices(changed(changes) if name == MASK_KIND else design).get(name, ())
    if wanted not in allowed:
        raise InputError(f"{name}: given {wanted}; allowed: {', '.join(allowed) or 'no change'}")
    if name == KIND:
        return _with_kind(design.holder, changes, wanted)
    if name == MASK_KIND:
        return _with_mask(changed(changes), changes, wanted)
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
    stay = {"kind", *({"at", "axis"} & {*HOLDER_KEYS.get(kind, ())})}
    return {**kept, KIND: kind, **{f"holder.{key}": None for key in given - stay}}


def _with_mask(design: Design, changes: Mapping[str, Any], kind: str) -> dict[str, Any]:
    faces = {name: one for name, one in changes.items() if name.startswith("mask.at.")}
    kept = {name: one for name, one in changes.items() if not name.startswith("mask.")}
    if kind == NO_MASK:
        return {**kept, MASK_KIND: NO_MASK}
    keys = {f"mask.{key}": MASK_KINDS[kind].get(key) for key in OF_MASK}
    if kind == "block":
        keys["mask.axis"] = _way_out(design)
    return {**kept, **faces, MASK_KIND: kind, **keys}


def _way_out(design: Design) -> list[float]:
    """Return the way along x, y or z of the chamber that the faces of a design's mask look most."""
    part = preview_part(design)
    assert design.mask is not None
    faces = chosen_triangles(part.mesh, design.mask.at, "mask.at")
    normal = area_vectors(part.vertices, part.mesh.triangles[faces]).sum(axis=0)
    way = np.zeros(3)
    way[np.abs(normal).argmax()] = np.sign(normal[np.abs(normal).argmax()]) or 1.0
    return [float(one) for one in way]


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
    triangles = part.mesh.triangles
    corners = np.unique(triangles[part.target])
    target = both[np.r_[corners, corners + len(points)]]
    return propose_sizes(
        both,
        float(target[:, 2].max()),
        max(design.shot.diameters),
        shape,
        target=None if is_within.all() else target,
        triangles=np.concatenate([triangles, triangles + len(points)]),
    ).plan
