"""Results folders whose files a test changes on purpose."""

import json
from pathlib import Path

from chamberopt.output.results.write import data_digests


def accept_changes(folder: Path) -> None:
    """Give the files of a results folder their present digests in its result.json."""
    file = folder / "result.json"
    data = json.loads(file.read_text(encoding="utf-8"))
    file.write_text(json.dumps(data | {"files": data_digests(folder)}), encoding="utf-8")
