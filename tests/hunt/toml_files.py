"""Draw wrong design and study files."""

from __future__ import annotations

import os
import random
import shutil
import tomllib
from pathlib import Path
from typing import Any

import tomlkit

ROOT = Path(__file__).resolve().parents[2]
ESCAPE = "\x1b]0;name\x07\x1b[31m"
NUMBERS = (
    0, 1, -1, 2, 0.5, -0.0, 1e-300, 1e300, -1e300, 10**18, -(10**18), float("inf"), float("nan"),
    1e-4, 100, 1000, 100000, 2**63 - 1, 3, 255,
)  # fmt: skip
TEXTS = (
    "", " ", "0.9", "auto", "all", "/dev/zero", "/dev/stdin", ".", "..", "/", "~", "$x$", "%s{}",
    "a\x00b", ESCAPE, "x" * 300, "x/" * 3000, "\u202eabc", "\U0001f6a7", "../designs/plate.toml",
    "loop.toml", "no-such-file.stl", "shape.py", "gear.stl", "imported", "cylinder", "box", "mm",
)  # fmt: skip


def odd_value(rng: random.Random, depth: int = 0) -> Any:
    """A value as a person, a script or an attacker might write it."""
    kind = rng.randrange(7 if depth < 3 else 4)
    if kind == 0:
        return rng.choice(NUMBERS)
    if kind == 1:
        return rng.choice(TEXTS)
    if kind == 2:
        return rng.choice((True, False))
    if kind == 3:
        return rng.choice((rng.uniform(-100, 100), rng.randrange(-10, 10_000)))
    if kind == 4:
        return [odd_value(rng, depth + 1) for _ in range(rng.choice((0, 1, 2, 3, 3, 40)))]
    names = [
        rng.choice((*TEXTS[:8], "C0", "e_at_m_s", "mu", "rpm", "min", "box_mm", ESCAPE))
        for _ in range(3)
    ]
    return {name: odd_value(rng, depth + 1) for name in names[: rng.randrange(4)]}


def _places(value: Any, way: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Keys and positions that lead to every value of a table."""
    inner = value.items() if isinstance(value, dict) else enumerate(value)
    found = []
    for step, one in inner:
        found.append((*way, step))
        if isinstance(one, (dict, list)):
            found += _places(one, (*way, step))
    return found


def _altered_values(rng: random.Random, source: str) -> str:
    data = tomllib.loads(source)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        places = _places(data)
        if not places:
            break
        *way, last = rng.choice(places)
        table: Any = data
        for step in way:
            table = table[step]
        act = rng.randrange(6)
        if act == 0:
            del table[last]
        elif act == 1 and isinstance(table, dict):
            table[rng.choice((*TEXTS, str(last)[:-1], str(last).upper()))] = table.pop(last)
        elif act == 2 and isinstance(table[last], (int, float)):
            table[last] = table[last] * rng.choice((-1, 0, 1e-3, 1e3, 10, 0.1, 2))
        else:
            table[last] = odd_value(rng)
    return tomlkit.dumps(data)


def _altered_text(rng: random.Random, source: str) -> bytes:
    content, at = source.encode(), rng.randrange(len(source))
    length = rng.randrange(1, 80)
    noise = bytes(rng.randrange(256) for _ in range(length))
    lines = source.splitlines()
    line = rng.randrange(len(lines))
    choices = (
        lambda: content[:at],
        lambda: content[:at] + content[at + length :],
        lambda: content[:at] + noise + content[at + length :],
        lambda: content[:at] + rng.choice(TEXTS).encode() + content[at:],
        lambda: "\n".join([*lines, lines[line]]).encode(),
        lambda: "\n".join(lines[:line] + lines[line + 1 :]).encode(),
        lambda: b"x = " + b"[" * rng.choice((10, 5000, 200_000)),
        lambda: b"x = " + b"9" * rng.choice((20, 5000, 200_000)),
        lambda: b"[" + b"a." * rng.choice((5, 2000)) + b"b]\n" + content,
        lambda: content.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\n"))),
        lambda: source.encode(rng.choice(("utf-16", "utf-8-sig", "utf-32"))),
        lambda: content * 2,
        lambda: content + b"#" + b" " * (3 << 20),
    )
    return rng.choice(choices)()


def _put_something_else(rng: random.Random, path: Path) -> None:
    """A link, device or folder in the place of a file."""
    kind = rng.randrange(6)
    if kind == 0:
        path.symlink_to(path.name)
    elif kind == 1:
        path.symlink_to("/dev/zero")
    elif kind == 2:
        os.mkfifo(path)
    elif kind == 3:
        path.mkdir()
    elif kind == 4:
        path.symlink_to("nowhere")
    else:
        path.symlink_to(rng.choice(("/proc/self/mem", "/dev/full", "/dev/null", "/proc/kmsg")))


def write_wrong_files(rng: random.Random, folder: Path, base: Path) -> list[str]:
    """Write a design or study with something wrong; the command that reads it.

    Args:
        base: folder with design.toml, study.toml and the files they name.
    """
    shutil.copy(base / "box.stl", folder)
    texts = {name: (base / name).read_text() for name in ("design.toml", "study.toml")}
    target = rng.choice(("design.toml", "design.toml", "study.toml"))
    for name, text in texts.items():
        if name != target:
            (folder / name).write_text(text)
    path = folder / target
    kind = rng.randrange(20)
    if kind == 0:
        _put_something_else(rng, path)
    elif kind < 6:
        path.write_bytes(_altered_text(rng, texts[target]))
    else:
        path.write_text(_altered_values(rng, texts[target]))
    opened = rng.choice((target, target, "study.toml"))
    words = rng.choice((["check"], ["check", "--json"]))
    if opened == "study.toml" and rng.random() < 0.2:
        words = ["sweep", "--grid", "0"]  # refused after the study was read, or before
    return [*words, opened]


def write_many_keys(rng: random.Random, folder: Path, base: Path) -> list[str]:
    """Write a design and a study with thousands of wrong keys, names or rows in one place."""
    count = rng.choice((20, 500, 5_000, 20_000))
    for name in ("box.stl", "design.toml", "study.toml"):
        shutil.copy(base / name, folder / name)
    keys = "".join(f"k{k} = {rng.choice((1, 'true'))}\n" for k in range(count))
    names = "".join(f'"shot.m{k}" = [1, 2]\n' for k in range(count))
    rows = "".join(f"[[zones]]\nname = {k}\n" for k in range(count))
    file, text = rng.choice(
        (
            ("design.toml", f"\n[tolerances]\n{names}"),
            ("design.toml", f"\n{rows}"),
            ("design.toml", f"\n{keys}"),
            ("design.toml", f"\n{'k' * 10 * count} = 1\n"),
            ("study.toml", f"\n{keys}"),
            ("study.toml", f"\n[begin_with]\n{keys}"),
        )
    )
    with (folder / file).open("a") as opened:
        opened.write(text)
    if rng.random() < 0.2:
        study = (folder / "study.toml").read_text()
        (folder / "study.toml").write_text(study.replace("[vary]\n", f"[vary]\n{names}"))
    return ["check", rng.choice(("design.toml", "study.toml"))]
