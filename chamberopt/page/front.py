"""Answer the requests of the front page, on which a part's file becomes a design to edit."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, get_args

from chamberopt.chamber.layout.pose import Pose
from chamberopt.chamber.layout.sizes import SHAPES
from chamberopt.chamber.layout.target import named_surfaces
from chamberopt.chamber.matters import Matter, MatterKind
from chamberopt.chamber.propose.proposal import Wanted
from chamberopt.chamber.shop import load_shop
from chamberopt.common.errors import InputError
from chamberopt.common.files import check_new_file, read_file, remove_file, write_bytes
from chamberopt.common.shipped import shipped_files
from chamberopt.common.toml_errors import MAX_CHOICES, closest_name, did_you_mean
from chamberopt.common.toml_fields import read_toml
from chamberopt.design.calibration import Calibration
from chamberopt.design.design import Design, validate
from chamberopt.design.load import is_study, load_design
from chamberopt.design.materials import alloys, balls
from chamberopt.documents.proposal import SIMULATED
from chamberopt.geometry.meshes.formats import SUFFIXES, is_mesh_name
from chamberopt.geometry.meshes.part_mesh import PartMesh, keep_part, read_part_cached
from chamberopt.geometry.meshes.surface_error import format_box
from chamberopt.geometry.meshes.units import METRES_PER, STATED, UnknownUnitError
from chamberopt.page.acts import Acts, free_folder, path_inside
from chamberopt.page.answers import (
    check_answers,
    part_answer,
    shape_answer,
    surface_answer,
    surfaces_answer,
)
from chamberopt.page.edited_file import alloy_suggestions
from chamberopt.page.page_words import balls_named, choices, on_page
from chamberopt.page.started_commands import JSON, OneCommand
from chamberopt.workflows.propose import DESIGN, PICTURE, Wishes

PART_NAME = re.compile(r"\w[\w .,()+-]{0,150}")
PROPOSING = "chamberopt new "  # begins a command that proposes a design
EXAMPLE = "fir_tree.step"  # of the shipped parts: with a unit, and names of its surfaces
MOST_NAMES = 40  # names of a part's surfaces that the page lists


class Front:
    """The page of a folder: it proposes designs for parts, and opens one of the designs.

    Attributes:
        acts: the requests of the page of the open design; None while the front page is shown.
        command: the command that either page has started.

    Args:
        folder: folder of the part files, into which proposals are written.
        file: a design to open at once, or a part of the folder to begin with; None for neither.
        trusted: whether the chamber's shape in a design may be a Python file, which is then run.
    """

    def __init__(self, folder: Path, file: Path | None, trusted: bool) -> None:
        self._folder, self._trusted = folder.resolve(), trusted
        self.command = OneCommand()
        self._asked: dict[str, object] = {}  # part, unit, wishes and target of the newest proposal
        self._first = file.name if file is not None and is_mesh_name(file.name) else ""
        self.acts = None if file is None or self._first else Acts(file, trusted, self.command)

    def end(self) -> None:
        """End the running command and the checks of the open design."""
        self.close(None)
        self.command.end()

    def inside(self, name: str) -> Path:
        """Return the path of a name in the folder that the shown page is for."""
        return self.acts.inside(name) if self.acts else path_inside(self._folder, name)

    def status(self, _: object) -> dict[str, object]:
        """Return what the pages show of the command.

        Of one that proposes a chamber it is also what was asked, the picture that there is by now,
        and the proposal in the words of the page: before the pilots have ended a draft.
        """
        now = self.command.status()
        if not str(now.get("command", "")).startswith(PROPOSING):
            return now
        picture = self._folder / str(now["result"]) / PICTURE
        with suppress(OSError):  # there is none yet
            now["picture"] = f"{now['result']}/{PICTURE}", picture.stat().st_mtime
        proposal = _on_page(now["answer"] or now.pop("draft"))
        return now | {"proposal": proposal, "asked": self._asked}

    def chamber(self, asked: Any) -> bytes:
        """Return the shape of the chamber that is proposed, of the draft until there is a design.

        With `exact` it is the cavity that is left of it by part, holder and mask.

        Raises InputError if none is proposed yet.
        """
        design = self._proposed()
        return next(check_answers(design)) if asked.get("exact") else shape_answer(design)

    def _proposed(self) -> Design:
        now: dict[str, Any] = self.command.status()
        if now.get("draft"):
            return Design.model_validate(now["draft"]["design"])
        if not now.get("answer"):
            raise InputError("no chamber is proposed yet")
        return load_design(self._folder / str(now["result"]) / DESIGN)

    def stop(self, _: object) -> dict[str, object]:
        self.command.stop()
        return self.command.status()

    def front(self, _: object) -> dict[str, object]:
        """Return what the front page offers: files of this folder by kind, and the catalogue."""
        tables = _tables(self._folder)
        return {
            "folder": str(self._folder),
            "first": self._first,
            "parts": [one.name for one in _plain_files(self._folder) if is_mesh_name(one.name)],
            "suffixes": SUFFIXES,
            "designs": [name for name, kind in tables if kind == "design"],
            "shops": [name for name, kind in tables if kind == "shop"],
            "calibrations": [name for name, kind in tables if kind == "calibration"],
            "alloys": alloy_suggestions(),
            "balls": choices("shot.material", [one.name for one in balls()]),
            "shapes": choices("chamber.shape", SHAPES),
        }

    def upload(self, name: str, content: bytes) -> dict[str, object]:
        """Write a part's file into the folder, unless it is there, and no other of this name is.

        A file that cannot be read as a part does not stay.
        """
        if not is_mesh_name(name) or not PART_NAME.fullmatch(name):
            raise InputError(f"{name}: not a part that can be read: {', '.join(SUFFIXES)}")
        path = self._folder / name
        if path.is_file() and path.stat().st_size == len(content) and read_file(path) == content:
            return {"part": name}
        if path.exists():
            raise InputError(f"{name} is in {self._folder} already: choose it, or rename yours")
        write_bytes(check_new_file(path), content)
        try:
            self._part_of_any_unit({"part": name, "unit": ""})
        except InputError:
            remove_file(path)
            raise
        return {"part": name}

    def example(self, _: object) -> dict[str, object]:
        """Write a part that comes with the program into the folder, unless it is there."""
        return self.upload(
            EXAMPLE, read_file(shipped_files() / "designs/parts" / EXAMPLE, follow=True)
        )

    def look(self, asked: Any) -> dict[str, object]:
        """Return a part's size and its surfaces' names and areas; its possible sizes by unit.

        The sizes by unit are empty where the file states its unit, or `asked` gives it.
        """
        try:
            mesh = self._part(asked)
        except UnknownUnitError as error:
            return {"sizes": error.sizes, "size": "", "names": []}
        names = [[one.name, one.text] for one in named_surfaces(mesh)[:MOST_NAMES]]
        return {"sizes": {}, "size": format_box(mesh.size), "names": names}

    def view(self, asked: Any) -> bytes:
        """Return what the page draws of a part, in any of its possible units."""
        return part_answer(self._part_of_any_unit(asked))

    def face(self, asked: Any) -> bytes:
        """Return which triangles of a part are its surface of a name."""
        return surface_answer(self._part_of_any_unit(asked), str(asked["name"]))

    def surfaces(self, asked: Any) -> bytes:
        """Return what of a part can be peened, by name or by a click: it takes longer to find."""
        return surfaces_answer(self._part_of_any_unit(asked))

    def _part(self, asked: Any) -> PartMesh:
        """Return a part of the folder.

        Raises UnknownUnitError if neither its file states its unit, nor `asked` gives it.
        """
        path, unit = path_inside(self._folder, str(asked["part"])), str(asked["unit"] or STATED)
        if unit not in (*METRES_PER, STATED):
            raise InputError(f"unit: given {unit}; allowed: {', '.join(METRES_PER)}")
        mesh = read_part_cached(path, unit)
        keep_part(mesh, path, mesh.unit)  # a design names the unit, and is opened without a wait
        return mesh

    def _part_of_any_unit(self, asked: Any) -> PartMesh:
        try:
            return self._part(asked)
        except UnknownUnitError as error:  # its form is the same in each
            return self._part({**asked, "unit": next(iter(error.sizes))})

    def propose(self, asked: Any) -> dict[str, object]:
        """Start the command `new` for a part of the folder, and return its status."""
        part = path_inside(self._folder, str(asked["part"]))
        wanted = {
            "unit": (asked["unit"], tuple(METRES_PER)),
            "material": (asked["material"], [one.name for one in alloys()]),
            "shot": (asked["shot"], [one.name for one in balls()]),
            "shape": (asked["shape"], SHAPES),
            "pose": (asked["pose"], get_args(Pose)),
        }
        arguments = ["new", f"./{part.relative_to(self._folder).as_posix()}"]
        faults = [
            f"--{option}: given {given!r}; {_hint(given, allowed)}"
            for option, (given, allowed) in wanted.items()
            if given and given not in allowed
        ]
        arguments += [f"--{option}={given}" for option, (given, _) in wanted.items() if given]
        wishes = {name: str(asked[name]).strip() for name in ("intensity", "coverage", "ball-mm")}
        faults += _faults(wishes, str(asked["material"]), bool(asked["pilot"]))
        if faults:
            raise InputError("\n".join(faults))
        arguments += [f"--{name}={text}" for name, text in wishes.items() if text]
        arguments += [f"--target={name}" for name in map(str, asked["target"])]
        for option in ("shop", "calibration"):
            if asked[option]:
                file = path_inside(self._folder, str(asked[option]))
                arguments += [f"--{option}=./{file.relative_to(self._folder).as_posix()}"]
        arguments += [] if asked["pilot"] else ["--no-pilot"]
        out = free_folder(self._folder, Path(part.stem))
        started = self.command.start([*arguments, JSON, f"--out={out}"], self._folder, out)
        self._asked = dict(asked)
        return started

    def open(self, asked: Any) -> dict[str, object]:
        """Show the page of a design from now on."""
        design = path_inside(self._folder, str(asked["design"]))
        opened = Acts(design, self._trusted, self.command)
        self.close(None)
        self.acts = opened
        return {}

    def close(self, _: object) -> dict[str, object]:
        """Show the front page from now on."""
        if self.acts is not None:
            self.acts.close()
        self.acts = None
        return {}


def _on_page(answer: Any) -> dict[str, object] | None:
    """Return a proposal that `new` has answered, in the words of the page; None before it has."""
    if answer is None:
        return None
    return {
        "sentence": on_page(answer["sentence"]),
        "rows": [
            {
                "name": row["name"],
                "value": on_page(row["value"]),
                "reasons": [on_page(text) for text in row["reasons"]],
            }
            for row in answer["rows"]
            if row["name"] != SIMULATED  # with their reasons among the numbers of the design
        ],
        "matters": [
            {
                "urgency": one.urgency.in_words,
                "mark": one.mark.capitalize(),
                "text": on_page(one.text),
                "balls": balls_named(one.text),
            }
            for one in _matters(answer)
        ],
        "choices": answer["choices"],
        "tables": [one for one in (answer["poses"], answer["trials"]) if one],
    }


def _matters(answer: Any) -> Iterator[Matter]:
    """Yield the matters of a proposal that `new` has answered."""
    for one in answer["matters"]:
        yield Matter(one["kind"] and MatterKind(one["kind"]), one["text"])


def _hint(given: str, allowed: Sequence[str]) -> str:
    """Return a hint for a wrong name of a list: a similar one, or the alloy of a metal's name."""
    if len(allowed) <= MAX_CHOICES or closest_name(given, allowed):
        return did_you_mean(given, allowed)
    of_metal = [one.name for one in alloys() if given.strip().lower() in one.metal.lower()]
    found = [name for name in of_metal if name in allowed]
    return f"did you mean {found[0]!r}?" if found else "choose one that the field lists"


def _faults(wishes: Mapping[str, str], alloy: str, pilot: bool) -> Iterator[str]:
    """Yield why `new` would refuse each of some wishes, in its words."""
    for name, text in wishes.items():
        if not text:
            continue
        try:
            coverage = float(text) if name == "coverage" else None
            ball_mm = float(text) if name == "ball-mm" else None
            wanted = Wanted(alloy=alloy, ball_mm=ball_mm, coverage=coverage)
            Wishes(wanted, text if name == "intensity" else None, pilot).require_possible()
        except ValueError:
            yield f"--{name}: given {text!r}; give a number"
        except InputError as error:
            yield str(error)


def _plain_files(folder: Path) -> list[Path]:
    """Return the files of a folder that are no links, by name."""
    return sorted(one for one in folder.iterdir() if one.is_file() and not one.is_symlink())


def _tables(folder: Path) -> list[tuple[str, str]]:
    """Return path and kind of each design, study, shop and calibration in a folder.

    The folders in it are looked into too.
    """
    found = []
    for path in sorted([*folder.glob("*.toml"), *folder.glob("*/*.toml")]):
        if path.resolve() != path:
            continue  # a link to elsewhere
        with suppress(InputError):
            found.append((path.relative_to(folder).as_posix(), _kind(path)))
    return found


def _kind(path: Path) -> str:
    """Return what a TOML file is. Raises InputError for none of design, study, machine and shop."""
    data = read_toml(path, "design")[1]
    if is_study(data):
        return "study"
    if "chamber" in data:
        return "design"
    with suppress(InputError):
        validate(Calibration, data, path)
        return "calibration"
    load_shop(path)
    return "shop"
