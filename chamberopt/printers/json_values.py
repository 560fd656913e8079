"""Turn a document into JSON values.

A chart becomes its name, and a view of parts in 3D becomes the number of parts.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

from chamberopt.documents.document import Chart, Document, PartView


def json_values(document: Document) -> dict[str, Any]:
    """Return all texts of a document as JSON values, with remarks on its 3D views of parts."""
    values: dict[str, Any] = _values(document)
    remarks = [remark for scene in document.scenes for remark in scene.remarks]
    return {**values, "remarks": remarks}


def _values(value: Any) -> Any:
    if isinstance(value, Chart):
        return {"chart": value.name, "caption": value.caption}
    if isinstance(value, PartView):
        return {"parts": len(value.scenes)}
    if is_dataclass(value):
        return {one.name: _values(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, str | bool):
        return value
    return [_values(one) for one in value]
