"""Failures that a hunt found, each as a fixed case."""

from __future__ import annotations

import io
import os
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh

from tests.hunt.base import write_base
from tests.hunt.command import Server, fault
from tests.hunt.meshes import whole_files

NAME = "\x1b]0;owned\x07"


def _vtk_with_huge_counts(folder: Path) -> None:
    text = whole_files()["text.vtp"].replace(
        b'NumberOfPoints="8"', b'NumberOfPoints="8000000000000"'
    )
    _as_part(folder, "part.vtp", text)


def _vtk_of_many_components(folder: Path) -> None:
    text = whole_files()["text.vtp"].replace(
        b'NumberOfComponents="3"', b'NumberOfComponents="3000000000.0"'
    )
    _as_part(folder, "part.vtp", text)


def _stl_of_a_wrong_normal(folder: Path) -> None:
    content = whole_files()["text.stl"].replace(b"facet normal ", b"facet normal x", 1)
    _as_part(folder, "part.stl", content)


def _ply_of_a_corner_beyond_all(folder: Path) -> None:
    content = whole_files()["ascii.ply"]
    head, body = content.split(b"end_header\n")
    lines = body.splitlines(keepends=True)
    lines[-1] = b"3 0 1 %d\n" % 2**63
    _as_part(folder, "part.ply", head + b"end_header\n" + b"".join(lines))


def _nastran_set(folder: Path) -> None:
    text = whole_files()["sets.bdf"].replace(b"3 THRU 5", b"3 THRU 5000000000")
    _as_part(folder, "part.bdf", text)


def _abaqus_set(folder: Path) -> None:
    text = whole_files()["sets.inp"].replace(b"\n1, 4, 1\n", b"\n1, 4000000000, 1\n")
    _as_part(folder, "part.inp", text)


def _abaqus_sets_of_sets(folder: Path) -> None:
    text = whole_files()["sets.inp"] + b"*ELSET, ELSET=c\na, b\n*ELSET, ELSET=c\nc, c\n" * 60
    _as_part(folder, "part.inp", text)


def _unpacked(folder: Path) -> None:
    _as_part(folder, "part.3mf", _archive(lambda model: model, {"more": 1 << 30}))


def _copies_of_copies(folder: Path) -> None:
    def twice_again(model: bytes) -> bytes:
        more = b"".join(
            b'<object id="%d"><components><component objectid="%d"/><component objectid="%d"/>'
            b"</components></object>" % (k + 1, k, k)
            for k in range(1, 60)
        )
        model = model.replace(b"</resources>", more + b"</resources>")
        return re.sub(rb"<item [^>]*/>", b'<item objectid="60"/>', model)

    _as_part(folder, "part.3mf", _archive(twice_again, {}))


def _archive(change: Callable[[bytes], bytes], zeros: dict[str, int]) -> bytes:
    """A 3MF with a changed model, and further files of zeros."""
    packed = io.BytesIO()
    whole = trimesh.Scene({"left": trimesh.creation.box()}).export(file_type="3mf")
    with (
        zipfile.ZipFile(io.BytesIO(whole)) as old,
        zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for name in old.namelist():
            content = old.read(name)
            new.writestr(name, change(content) if name.endswith("model") else content)
        for name, size in zeros.items():
            with new.open(name, "w", force_zip64=True) as file:
                for _ in range(0, size, 1 << 24):
                    file.write(bytes(1 << 24))
    return packed.getvalue()


def _as_part(folder: Path, name: str, content: bytes) -> None:
    (folder / name).write_bytes(content)
    path = folder / "design.toml"
    text = re.sub(r"(?ms)^\[part.target\].*?(?=^\[)", "", path.read_text())
    path.write_text(text.replace("box.stl", name))


def _in_design(old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        path = folder / "design.toml"
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    return change


def _design_of_study(text: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        path = folder / "study.toml"
        path.write_text(path.read_text().replace('"design.toml"', text))

    return change


def _instead_of_design(put: Callable[[Path], None]) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        (folder / "design.toml").unlink()
        put(folder / "design.toml")

    return change


READ = ["check", "design.toml"]
STUDY = ["check", "study.toml"]
MESH = 'mesh = "box.stl"'
# What is done to the files, the command, and what it says; None where it works.
FOUND: dict[str, tuple[Callable[[Path], None], list[str], str | None]] = {
    "VTK's counts": (_vtk_with_huge_counts, READ, "NumberOfPoints is '8000000000000'"),
    "a normal that is no number": (_stl_of_a_wrong_normal, READ, None),
    "a corner beyond all": (_ply_of_a_corner_beyond_all, READ, "cannot be read as PLY.*damaged"),
    "a set THRU 5e9": (_nastran_set, READ, None),
    "a set that generates 4e9": (_abaqus_set, READ, None),
    "sets that double": (_abaqus_sets_of_sets, READ, None),
    "a 3MF that unpacks": (_unpacked, READ, r"at most 1,024 MiB are read"),
    "copies of copies": (_copies_of_copies, READ, r"copies of bodies, at most 10,000 are read"),
    "a device": (_design_of_study('"/dev/zero"'), STUDY, "/dev/zero: is not a plain file"),
    "a pipe": (_instead_of_design(os.mkfifo), READ, "design.toml: is not a plain file"),
    "a plain file that never ends": (
        _instead_of_design(lambda path: path.symlink_to("/proc/kmsg")),
        READ,
        "design.toml:",  # not a plain file, or what the kernel has just said is no TOML
    ),
    "a mesh that is a device": (_in_design("box.stl", "/dev/zero"), READ, "/dev/zero"),
    "a large text": (
        _instead_of_design(lambda path: path.write_bytes(b" " * (1 << 21))),
        READ,
        "of 2.0 MiB, at most 1 MiB are read",
    ),
    "a link to itself": (
        _instead_of_design(lambda path: path.symlink_to(path.name)),
        READ,
        "design.toml: cannot be read: Too many levels",
    ),
    "a long name": (_in_design(MESH, f'mesh = "{"x" * 300}"'), READ, "File name too long"),
    "a name with a null": (_in_design(MESH, 'mesh = "a\\u0000b"'), READ, "part.mesh: "),
    "a name that commands": (
        _in_design("[shot]", '[shot]\n"\\u001b]0;owned\\u0007" = 1'),
        READ,
        r"shot\.\\x1b\]0;owned\\x07: unknown key",
    ),
    "an argument that commands": (lambda _: None, ["report", NAME], r"\\x1b\]0;owned\\x07"),
    "components without end": (
        _vtk_of_many_components,
        READ,
        "NumberOfComponents is '3000000000.0', expected a whole number up to 1000",
    ),
    "true for a number": (
        _in_design("C0 = 0.91, v0_m_s = 1.5", "C0 = true, v0_m_s = 1.5"),
        READ,
        "materials.shot.C0: given true; allowed: a number",
    ),
    "a text for a number": (
        _in_design("C0 = 0.91, v0_m_s = 1.5", 'C0 = "0.9", v0_m_s = 1.5'),
        READ,
        "write it without quotes",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", FOUND)
def test_what_a_hunt_found_stays_mended(server: Server, tmp_path: Path, case: str) -> None:
    change, words, message = FOUND[case]
    write_base(tmp_path)
    change(tmp_path)

    outcome = server.run(tmp_path, words)

    assert fault(outcome) is None, outcome.errors
    assert outcome.status == (0 if message is None else 2), outcome.errors
    assert re.search(message or "", outcome.errors), outcome.errors
