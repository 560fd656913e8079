"""Draw altered results and interrupted runs, and the command that meets them.

Half of the altered results are forged: their digests are those of the altered files, so that what
refuses them is not the digest but what is known of a result's values.
"""

from __future__ import annotations

import csv
import io
import json
import random
import re
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import FORMULA
from chamberopt.results.load import content_sha256
from chamberopt.results.write import data_digests
from tests.hunt.toml_files import odd_value

LOOK = (
    ["report", "{}"],
    ["report", "{}", "--sheet", "--json"],
    ["compare", "result", "{}"],
    ["compare", "{}", "result"],
    ["export", "{}", "--to", "fields-vtp"],
    ["export", "{}", "--to", "chamber-stl"],
    ["export", "study", "--to", "study-csv"],
    ["inspect", "{}", "--html", "page.html"],
)
SIMULATE_AGAIN = (
    ["dents", "{}", "d.png"], ["replay", "{}", "r.gif"], ["energy", "{}", "e.png"],
    ["export", "{}", "--to", "impacts-csv"],
    ["export", "{}", "--to", "fields-abaqus"], ["export", "{}", "--to", "chamber-3mf"],
)  # fmt: skip
FORMULAS = ("=1+1", "=cmd|' /C calc'!A0", "+1+1", "-2+3", "@SUM(A1)", "\t=1", "\r=1", '="a"')
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$|[-+]inf$")
RESUME = ["run", "study.toml", "--no-ranges", "--out", "study"]


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
        with suppress(ValueError, IndexError):  # it was altered already, or emptied
            _alter_json(rng, path)
    elif kind == 3:
        path.unlink()
        rng.choice((path.mkdir, lambda: path.symlink_to(path.name), lambda: None))()
    else:
        _alter_bytes(rng, path)


def _odd_number(rng: random.Random) -> float:
    return rng.choice((np.nan, np.inf, -np.inf, 1e300, -1e300, -1.0, 0.0, 0.5, 2.0, 1e9, 2**40))


def _alter_array(rng: random.Random, array: np.ndarray) -> np.ndarray:
    """Another value, length, shape or type."""
    kind = rng.randrange(6)
    if kind < 3 and array.size:
        altered = array.copy().ravel()
        with np.errstate(all="ignore"):
            chosen = rng.choice((0, -1, slice(None)))
            altered[chosen] = np.array(_odd_number(rng)).astype(array.dtype)
        return altered.reshape(array.shape)
    if kind == 3:
        return array[: len(array) // 2] if array.ndim else array
    if kind == 4:
        return np.stack([array] * 3, axis=-1)
    with np.errstate(all="ignore"):
        return array.astype(rng.choice(("f8", "f4", "i8", "u1", "c16", "U9")))


def _alter_npz(rng: random.Random, path: Path) -> None:
    """Alter an array of an .npz file, or what its tree says."""
    with np.load(path) as file:
        arrays = dict(file)
    name = rng.choice(sorted(arrays))
    if name == "tree":
        tree = json.loads(arrays[name].tobytes())
        table, key = rng.choice(_values(tree))
        table[key] = odd_value(rng)
        arrays[name] = np.frombuffer(json.dumps(tree).encode(), np.uint8)
    else:
        arrays[name] = _alter_array(rng, arrays[name])
    packed = io.BytesIO()
    np.savez(packed, **arrays)
    path.write_bytes(packed.getvalue())


def _forge(rng: random.Random, folder: Path) -> None:
    """Alter values of a result, and all digests with them."""
    files = sorted(path for path in folder.iterdir() if path.suffix in (".npz", ".jsonl"))
    main = folder / "result.json"
    path = main if rng.random() < 0.4 or not files else rng.choice(files)
    if path.suffix == ".npz":
        _alter_npz(rng, path)
    else:
        first, *rest = path.read_text().splitlines() if path != main else [path.read_text()]
        data = json.loads(first)
        for _ in range(rng.choice((1, 1, 2))):
            table, key = rng.choice(_values(data))
            table[key] = odd_value(rng) if rng.random() < 0.9 else 10**400
        path.write_text("\n".join([json.dumps(data), *rest, ""]))
    data = json.loads(main.read_text())
    if isinstance(data.get("files"), dict):
        data["files"] |= data_digests(folder)
    main.write_text(json.dumps({**data, "sha256": content_sha256(data)}))


def write_formulas(rng: random.Random, folder: Path, base: Path) -> list[str]:
    """Put formulas for spreadsheets into names and texts of a study's history, and export it."""
    for name in ("study", "sweep"):
        shutil.copytree(base / name, folder / name)
    chosen = rng.choice(("study", "sweep"))
    history = folder / chosen / "history.jsonl"
    rows = [json.loads(line) for line in history.read_text().splitlines()]
    for row in rows:
        texts = [(table, key) for table, key in _values(row) if isinstance(table[key], str)]
        for table, key in rng.sample(texts, min(len(texts), rng.randrange(1, 4))):
            table[key] = rng.choice(FORMULAS)
        if rng.random() < 0.5:
            row["reason"] = rng.choice(FORMULAS)
        if rng.random() < 0.3:
            row["parameters"] = {rng.choice(FORMULAS): 1.0, **row["parameters"]}
    history.write_text("".join(json.dumps(row) + "\n" for row in rows))
    main = folder / chosen / "result.json"
    data = json.loads(main.read_text())
    data["files"] |= data_digests(folder / chosen)
    main.write_text(json.dumps({**data, "sha256": content_sha256(data)}))
    return ["export", chosen, "--to", "study-csv", "--out", "table.csv"]


def formula_cells(folder: Path) -> list[str]:
    """Cells of the tables in a folder that a spreadsheet would take for formulas."""
    found = []
    for path in folder.glob("*.csv"):
        with path.open(newline="") as file:
            cells = [cell for row in csv.reader(file) for cell in row]
        found += [cell for cell in cells if cell.startswith(FORMULA) and not NUMBER.match(cell)]
    return found


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
        if rng.random() < 0.5:
            _alter_npz(rng, rng.choice(sorted((folder / "study" / "confirm").iterdir())))
        return [*RESUME, *rng.choice(([], ["--json"]))]
    if rng.random() < 0.5:
        _forge(
            rng, folder / rng.choice((chosen, "study/start") if chosen == "study" else (chosen,))
        )
        looked = rng.choice((*LOOK, *SIMULATE_AGAIN))
        return [word.format(chosen) for word in looked]
    for _ in range(rng.choice((1, 1, 2))):
        path = rng.choice(main if rng.random() < 0.6 else files)
        if path.is_file():
            _alter(rng, path)
    return [word.format(chosen) for word in rng.choice(LOOK)]
