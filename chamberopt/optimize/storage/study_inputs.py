"""What a study was asked, by which program: kept in its folder, and compared before anything goes on there."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.errors import InputError
from chamberopt.common.versions import program_versions

if TYPE_CHECKING:
    from chamberopt.design.load import Design
    from chamberopt.optimize.study import Study

FORMAT = 1
SHOWN = 12  # differences in one message


def study_inputs(study: Study, plan: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Everything that a study's history depends on, as plain JSON: its values, not the text they were written in.

    A file that the design names, such as the part's mesh, stands with its name and the sha256 of its content, wherever
    it lies. plan: of a sweep.
    """
    values = study.model_dump(mode="json", exclude={"design"})
    values["design"] = _with_files(study.design.model_dump(mode="json"))
    plain = json.loads(
        json.dumps(
            {"format": FORMAT, "study": values, "sweep": plan, "program": program_versions()}
        )
    )
    assert isinstance(plain, dict)
    return plain


def require_same_files(design: Design, before: Mapping[str, Any], folder: Path) -> None:
    """InputError when a file that the design names is not what it was when `before` was asked."""
    changed = differences(before["study"]["design"], _with_files(design.model_dump(mode="json")))
    if changed:
        lines = [
            f"{folder}: changed while the study ran, the evaluation under way is not kept:",
            *changed[:SHOWN],
        ]
        raise InputError(
            "\n  ".join(lines)
            + "\nto go on, restore what it was and run the study again on this folder"
        )


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Each value that is not what it was, a line each: `study.design.shot.mass_g: was 5.0, is 6.0`."""
    old, new = _flat(before), _flat(now)
    names = [*old, *(name for name in new if name not in old)]
    return [
        f"{name}: was {_shown(old, name)}, is {_shown(new, name)}"
        for name in names
        if name not in old or name not in new or old[name] != new[name]
    ]


def require_same(folder: Path, before: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """InputError that says what changed since the study in the folder began, and what to do."""
    changed = differences(before, now)
    if not changed:
        return
    more = [f"and {len(changed) - SHOWN} more"] if len(changed) > SHOWN else []
    remedy = (
        "to go on there, restore what it was; to run what it is now, give another folder (--out)"
    )
    lines = [f"{folder}: the study in this folder began otherwise:", *changed[:SHOWN], *more]
    raise InputError("\n  ".join(lines) + f"\n{remedy}")


def _with_files(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _with_files(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_with_files(item) for item in value]
    if isinstance(value, str) and Path(value).suffix and Path(value).is_file():
        digest = hashlib.sha256(Path(value).read_bytes()).hexdigest()
        return {"file": Path(value).name, "sha256": digest}
    return value


def _flat(value: Any, prefix: str = "") -> dict[str, Any]:
    """Dotted names of the values in nested tables."""
    if not isinstance(value, Mapping) or not value:
        return {prefix: value}
    flat: dict[str, Any] = {}
    for name, item in value.items():
        flat |= _flat(item, f"{prefix}.{name}" if prefix else str(name))
    return flat


def _shown(flat: Mapping[str, Any], name: str) -> str:
    value = json.dumps(flat[name], ensure_ascii=False) if name in flat else "not there"
    return value if len(value) <= 80 else value[:77] + "..."
