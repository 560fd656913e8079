"""Draw wrong mesh files of every format that is read."""

from __future__ import annotations

import functools
import io
import random
import re
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import trimesh

from tests.chamberopt.geometry.meshes.test_formats import intact_files
from tests.helpers.mesh_files import CORNERS, QUADS, SIDES, write_ascii_stl, write_stl

ROOT = Path(__file__).parents[2]
HUGE = (0, -1, 1, 10**9, 2**31 - 1, 2**32 - 1, 2**40, 10**12, 2**63 - 1, 2**64 - 1, 10**30)
NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
WORDS = (b"nan", b"inf", b"-inf", b"1e308", b"1e999", b"-0", b"0x10", b"\xff\xfe", b"'", b'"', b"")


@functools.cache
def whole_files() -> dict[str, bytes]:
    """File name -> a box of 20 x 30 x 40 mm."""
    import pyvista

    files = intact_files()
    box = trimesh.creation.box(SIDES)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        corners = box.vertices[box.faces]
        files["binary.stl"] = write_stl(folder / "a.stl", corners).read_bytes()
        files["text.stl"] = write_ascii_stl(folder / "b.stl", corners).read_bytes()
        surface = pyvista.PolyData(CORNERS, np.insert(np.array(QUADS), 0, 4, axis=1).ravel())
        surface.cell_data["zone"] = np.array([7] + [8] * 5)
        for suffix in ("vtp", "vtu", "vtk"):
            data = surface.cast_to_unstructured_grid() if suffix == "vtu" else surface
            for binary in (True, False):
                path = folder / f"{'binary' if binary else 'text'}.{suffix}"
                data.save(path, binary=binary)
                files[path.name] = path.read_bytes()
    for encoding in ("ascii", "binary"):
        files[f"{encoding}.ply"] = box.export(file_type="ply", encoding=encoding)
    files["box.3mf"] = trimesh.Scene({"left": box}).export(file_type="3mf")
    files["sets.bdf"] = b"SET 4 = 1, 3 THRU 5\nBEGIN BULK\n" + files["box.dat"] + b"ENDDATA\n"
    sets = b"*ELSET, ELSET=a, GENERATE\n1, 4, 1\n*ELSET, ELSET=b\na, a\n*NSET, NSET=n\n1, 2, 3\n"
    files["sets.inp"] = files["box.inp"] + sets
    return files


def _altered(rng: random.Random, whole: bytes) -> bytes:
    at, length = rng.randrange(len(whole)), rng.randrange(1, 60)
    noise = bytes(rng.randrange(256) for _ in range(length))
    numbers = list(NUMBER.finditer(whole))
    kind = rng.randrange(9 if numbers else 5)
    if kind == 0:
        return whole[:at]
    if kind == 1:
        return whole[:at] + whole[at + length :]
    if kind == 2:
        return whole[:at] + noise + whole[at + length :]
    if kind == 3:  # a count, or a length of a block
        value = rng.choice(HUGE) & (2**64 - 1)
        size = rng.choice((2, 4, 8))
        word = value.to_bytes(17, "little")[:size]
        at -= at % rng.choice((1, 4))
        return whole[:at] + word + whole[at + size :]
    if kind == 4:
        lines = whole.splitlines(keepends=True)
        first = rng.randrange(len(lines))
        chosen = lines[first : first + rng.randrange(1, 6)]
        return b"".join([*lines[:first], *chosen * rng.randrange(3), *lines[first:]])
    found = rng.choice(numbers)
    word = rng.choice(WORDS) if kind == 5 else str(rng.choice(HUGE)).encode()
    if kind == 6:
        word = str(float(found[0]) * rng.choice((-1, 1e-9, 1e9, 1e3, 1e-3, 1e200))).encode()
    return whole[: found.start()] + word + whole[found.end() :]


def _altered_archive(rng: random.Random, whole: bytes) -> bytes:
    """A 3MF whose model was altered before it was packed."""
    packed = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(whole)) as old,
        zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, _altered(rng, content) if name.endswith("model") else content)
    return packed.getvalue()


def write_damaged_step(rng: random.Random, folder: Path, base: Path) -> list[str]:
    """Write a design whose part is a STEP file with odd numbers, and without some entities."""
    lines = (ROOT / "designs/parts/fir_tree.step").read_text().splitlines(keepends=True)
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(len(lines))
        numbers = list(re.finditer(r"-?\d+\.\d*(E-?\d+)?", lines[at]))
        if numbers:
            one = rng.choice(numbers)
            word = rng.choice(("1.E12", "-1.E12", "0.", "1.E-12", "1.E300", "-1."))
            lines[at] = lines[at][: one.start()] + word + lines[at][one.end() :]
        elif lines[at].startswith("#"):
            del lines[at]
    (folder / "part.step").write_text("".join(lines))
    design = (base / "design.toml").read_text().replace('"box.stl"', '"part.step"')
    text = re.sub(r"(?ms)^\[part.target\].*?(?=^\[)", "", design).replace('unit = "mm"\n', "")
    (folder / "design.toml").write_text(text)
    return ["check", "design.toml"]


def write_wrong_mesh(rng: random.Random, folder: Path, base: Path) -> list[str]:
    """Write a design whose part is a damaged file; the command that reads it."""
    name = rng.choice(sorted(whole_files()))
    content = whole_files()[name]
    if name.endswith("3mf") and rng.random() < 0.7:
        content = _altered_archive(rng, content)
    else:
        for _ in range(rng.choice((1, 1, 1, 2, 5))):
            content = _altered(rng, content) or b"x"
    if rng.random() < 0.05:
        name = rng.choice(("part", "part.stl", "part.inp", "part.vtu", "$x$.step"))
    (folder / name).write_bytes(content)
    design = (base / "design.toml").read_text()
    setup = re.sub(r'mesh = "[^"]*"', f'mesh = "{name}"', design)
    (folder / "design.toml").write_text(re.sub(r"(?ms)^\[part.target\].*?(?=^\[)", "", setup))
    return ["check", "design.toml"]
