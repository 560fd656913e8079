"""Draw altered results and interrupted runs, and the command that meets them."""

from __future__ import annotations

import json
import random
import shutil
from pathlib import Path
from typing import Any

from tests.hunt.toml_files import odd_value

LOOK = (
    ["report", "{}"], ["report", "{}", "--json"], ["compare", "result", "{}"],
    ["compare", "{}", "result"], ["export", "{}", "--to", "fields-vtp"],
    ["export", "{}", "--to", "chamber-stl"], ["export", "study", "--to", "study-csv"],
    ["inspect", "{}", "--html", "page.html"],
)  # fmt: skip
RESUME = ["run", "study.toml", "--out", "study"]


def _values(table: Any) -> list[tuple[Any, Any]]:
    """(table or list, key) of every value in nested JSON."""
    found: list[tuple[Any, Any]] = []
    for key, value in table.items() if isinstance(table, dict) else enumerate(table):
        found.append((table, key))
        if isinstance(value, (dict, list)):
            found += _values(value)
    return found


def _alter_json(rng: random.Random, path: Path) -> None:
    """Change some values of a JSON file, or of a log's first line; digests stay as they were."""
    text = path.read_text()
    data = json.loads(text.splitlines()[0] if path.suffix == ".jsonl" else text)
    for _ in range(rng.choice((1, 1, 2, 4))):
        table, key = rng.choice(_values(data))
        if rng.random() < 0.3:
            del table[key]
            if not data:
                break
        else:
            table[key] = odd_value(rng)
    path.write_text(json.dumps(data))


def _alter_bytes(rng: random.Random, path: Path) -> None:
    content = path.read_bytes()
    at, length = rng.randrange(len(content) + 1), rng.randrange(1, 40)
    noise = bytes(rng.randrange(256) for _ in range(length))
    kinds = (content[:at], content[:at] + noise + content[at + length :], content[:at] + noise, b"")
    path.write_bytes(rng.choice(kinds))


def _alter(rng: random.Random, path: Path) -> None:
    kind = rng.randrange(6)
    if kind < 3 and path.suffix in (".json", ".jsonl"):
        _alter_json(rng, path)
    elif kind == 3:
        path.unlink()
        rng.choice((path.mkdir, lambda: path.symlink_to(path.name), lambda: None))()
    else:
        _alter_bytes(rng, path)


def write_altered_results(rng: random.Random, folder: Path, base: Path) -> list[str]:
    """Copy a base with results, alter files of one of them, and draw a command that reads it."""
    for source in base.iterdir():
        copy = shutil.copytree if source.is_dir() else shutil.copy
        copy(source, folder / source.name)
    chosen = rng.choice(("result", "study", "study", "sweep"))
    files = sorted(path for path in (folder / chosen).rglob("*") if path.is_file())
    main = [path for path in files if path.suffix in (".json", ".jsonl")]
    if chosen == "study" and rng.random() < 0.3:  # as if it had been interrupted
        history = folder / "study" / "history.jsonl"
        content = history.read_bytes()
        kept = {"history.jsonl", "inputs.json", "timings.jsonl", "design.toml", "study.toml"}
        for path in files:
            if path.name not in kept and path.suffix != ".npz":
                path.unlink()
        history.write_bytes(content[: rng.randrange(len(content))])
        return [*RESUME, *rng.choice(([], ["--json"]))]
    for _ in range(rng.choice((1, 1, 2))):
        path = rng.choice(main if rng.random() < 0.6 else files)
        if path.is_file():
            _alter(rng, path)
    return [word.format(chosen) for word in rng.choice(LOOK)]
