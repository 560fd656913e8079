"""The inputs of a study: what its results depend on, stored and compared before it is resumed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.errors import InputError
from chamberopt.common.files import open_plain
from chamberopt.common.versions import program_versions

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.optimize.study import Study

FORMAT = 1
MAX_DIFFERENCES = 12  # in one message


def study_inputs(study: Study, plan: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Everything that the trials depend on, as plain JSON: values, not the text of the files.

    A file that the design names, such as the part's mesh, is stored as its name and the sha256 of
    its content, so that it may be moved. The plan is that of a sweep.
    """
    values = study.model_dump(mode="json", exclude={"design"})
    values["design"] = _with_digests(study.design.model_dump(mode="json"))
    inputs = {"format": FORMAT, "study": values, "sweep": plan, "program": program_versions()}
    plain = json.loads(json.dumps(inputs))
    assert isinstance(plain, dict)
    return plain


def require_same_inputs(folder: Path, before: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Raise InputError if the study in the folder was begun with other inputs."""
    title = f"{folder}: the study in this folder began otherwise:"
    remedy = "to resume it, restore these inputs; to run the new study, give another folder (--out)"
    _require_same(before, now, title, remedy)


def require_same_files(design: Design, before: Mapping[str, Any], folder: Path) -> None:
    """Raise InputError if a file that the design names has changed since the study began."""
    title = f"{folder}: changed while the study ran, so the running evaluations are not kept:"
    remedy = "to resume, restore the file and run the study again on this folder"
    now = _with_digests(design.model_dump(mode="json"))
    _require_same(before["study"]["design"], now, title, remedy)


def _require_same(
    before: Mapping[str, Any], now: Mapping[str, Any], title: str, remedy: str
) -> None:
    """Raise InputError that lists differences: `study.design.shot.mass_g: was 5.0, is 6.0`."""
    old, new = _flatten(before), _flatten(now)
    changed = [
        f"{name}: was {_format(old, name)}, is {_format(new, name)}"
        for name in {**old, **new}
        if name not in old or name not in new or old[name] != new[name]
    ]
    if len(changed) > MAX_DIFFERENCES:
        hidden = len(changed) - MAX_DIFFERENCES
        changed = [*changed[:MAX_DIFFERENCES], f"and {hidden} more"]
    if changed:
        raise InputError("\n  ".join([title, *changed]) + f"\n{remedy}")


def _with_digests(value: Any) -> Any:
    """The value with each path of a file replaced by the file's name and sha256."""
    if isinstance(value, dict):
        return {name: _with_digests(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_with_digests(item) for item in value]
    if isinstance(value, str) and Path(value).suffix and Path(value).is_file():
        with open_plain(Path(value), follow=True) as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return {"file": Path(value).name, "sha256": digest}
    return value


def _flatten(value: Any, prefix: str = "") -> dict[str, Any]:
    """The values of nested tables by dotted name."""
    if not isinstance(value, Mapping) or not value:
        return {prefix: value}
    flat: dict[str, Any] = {}
    for name, item in value.items():
        flat |= _flatten(item, f"{prefix}.{name}" if prefix else str(name))
    return flat


def _format(flat: Mapping[str, Any], name: str) -> str:
    value = json.dumps(flat[name], ensure_ascii=False) if name in flat else "absent"
    return value if len(value) <= 80 else value[:77] + "..."
