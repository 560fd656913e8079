"""Results folders whose files a test changes on purpose."""

import json
from pathlib import Path
from typing import Any

from chamberopt.results.load import content_sha256
from chamberopt.results.write import data_digests


def replace_result(folder: Path, data: dict[str, Any]) -> None:
    """Write another content of a result.json, as if it had been there from the start."""
    whole = {**data, "sha256": content_sha256(data)}
    (folder / "result.json").write_text(json.dumps(whole), encoding="utf-8")


def accept_changes(folder: Path) -> None:
    """Give the files of a results folder their present digests in its result.json."""
    file = folder / "result.json"
    data = json.loads(file.read_text(encoding="utf-8"))
    replace_result(folder, data | {"files": data_digests(folder)})
