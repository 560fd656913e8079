"""Answer the requests of the web page on which a user edits a design."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import count, product
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from chamberopt.chamber.matters import matter_of
from chamberopt.chamber.part import preview_part
from chamberopt.chamber.propose.text import GOALS, study_of_design
from chamberopt.common.errors import InputError
from chamberopt.common.files import (
    INPUTS,
    RESULT,
    check_new_file,
    is_new_or_empty,
    private_folder,
    read_file,
    remove_file,
    write_text,
)
from chamberopt.common.key_words import AIMS
from chamberopt.common.toml_fields import read_toml
from chamberopt.coverage.metrics import OBJECTIVES, metric_names, metric_problem
from chamberopt.design.design import Design
from chamberopt.design.load import is_study
from chamberopt.documents.answer import on_average, stopped_text
from chamberopt.documents.comparison import after_shorter_time
from chamberopt.documents.document import Fold, Section, Sentence
from chamberopt.documents.overview import comparison_overview
from chamberopt.documents.proposal import as_sentence
from chamberopt.documents.report import answer_section, notes_section
from chamberopt.documents.study import aim_in_words
from chamberopt.documents.wanted import not_told, times_longer
from chamberopt.documents.wording import metric_label, named_value
from chamberopt.geometry.faces import Border
from chamberopt.page.answers import (
    face_names,
    packed,
    part_answer,
    picked_answer,
    shape_answer,
    step_texts,
    surface_answer,
)
from chamberopt.page.checker import Checker
from chamberopt.page.duration import AS_ASKED, EFFORTS, Foretold, foretold, tried
from chamberopt.page.edited_file import OF_MATTERS, EditedFile, custom_shape, design_fields
from chamberopt.page.further_study import write_further_study
from chamberopt.page.page_words import (
    CHOICES,
    amplitudes_named,
    balls_named,
    explained,
    names_met,
    on_page,
)
from chamberopt.page.picking import Picker
from chamberopt.page.started_commands import OneCommand
from chamberopt.page.structure import (
    KEPT,
    picked_surfaces,
    restructured,
    with_added_step,
    without_step,
)
from chamberopt.page.study_answers import candidate_answer, candidates_answer, model_answer, version
from chamberopt.printers.html import section
from chamberopt.printers.report_page import REPORT, parts_content, viewer
from chamberopt.printers.sheet_page import SHEET
from chamberopt.results.compare.comparison import compare, differing_values, labels, values_before
from chamberopt.results.load import Result, load_result, load_start
from chamberopt.search.study import load_study
from chamberopt.search.study.parameters import Vary
from chamberopt.search.study_folder import STUDY, is_finished, is_study_folder, read_inputs
from chamberopt.workflows.comparison_folder import draw_differences

MOST_VALUES = 6  # by which results differ, in the line of each
DEEPEST = 4  # levels of folders below the design's folder that are searched for results


def list_results(folder: Path, now: Design) -> list[dict[str, Any]]:
    """List all results and studies below a folder, the newest first.

    Each has a line on its coverage, and on the numbers of its design by which the results differ.
    The line `stale` says in what its design was another than the one on the page; "" for nothing.
    `before` has these values as changes of the design on the page, as far as they are such.
    The line `stopped` says after how many replicas a user stopped it; "" for others.

    Args:
        now: the design on the page.
    """
    rows, results = [], {}
    for where in _result_folders(folder):
        row: dict[str, Any] = {"folder": where.relative_to(folder).as_posix()}
        row |= {name: (where / name).is_file() for name in (REPORT, SHEET)}
        row["is_study"] = is_study_folder(where)
        try:
            result = load_result(where)
            results[row["folder"]] = result
            row["text"] = on_average(result)
            before = values_before(result, now)
            row["stale"], row["before"] = _stale(before), _as_changes(before)
            row["stopped"] = stopped_text(result)
        except InputError as error:
            unfinished = row["is_study"] and not is_finished(where)
            row["text"] = "a study that has not finished" if unfinished else str(error)
            row["unusable"] = True
        rows.append(row)
    words = dict(zip(results, _differences([*results.values()]), strict=True))
    for row in rows:
        row["text"] = "; ".join(filter(None, (words.get(row["folder"]), row["text"])))
        row["words"] = on_page(row["text"])
    return rows


def _result_folders(folder: Path) -> list[Path]:
    """Return the folders of all results and studies below a folder, the newest first."""
    found: dict[Path, float] = {}
    for depth, name in product(range(1, DEEPEST + 1), (INPUTS, RESULT)):
        for file in folder.glob("/".join(["*"] * depth + [name])):
            if file.parent.resolve().is_relative_to(folder):  # no link to elsewhere
                found[file.parent] = max(found.get(file.parent, 0.0), file.lstat().st_mtime)
    return sorted(found, key=lambda one: found[one], reverse=True)


def _differences(results: Sequence[Result]) -> list[str]:
    """Return for each result in words the first values by which the results differ.

    Values of the accuracy, and what only tells versions of a shape apart, are left out.
    """
    found = differing_values(results)
    names = [name for name in found if "." in name and not name.startswith("process.accuracy.")]
    return [
        ", ".join(
            _value_in_words(name, found[name][k])
            for name in names[:MOST_VALUES]
            if found[name][k] is not None
        )
        for k in range(len(results))
    ]


def _value_in_words(name: str, value: object) -> str:
    return named_value(name, CHOICES.get(str(value)) or value)


def _as_changes(before: Mapping[str, object]) -> dict[str, object]:
    """Return numbers and texts by dotted names as changes of a design, each item of a list alone.

    There are none if any value is something else, or absent.
    """
    changes: dict[str, object] = {}
    for name, value in before.items():
        items = value if isinstance(value, list | tuple) else None
        named = {name: value} if items is None else {f"{name}.{k}": x for k, x in enumerate(items)}
        if not all(isinstance(one, int | float | str) for one in named.values()):
            return {}
        changes |= named
    return changes


def _stale(before: Mapping[str, object]) -> str:
    """Return a sentence on the numbers that a result was simulated with, if others are now."""
    texts = [_value_in_words(*one) for one in before.items()][:MOST_VALUES]
    more = f" and {len(before) - MOST_VALUES} more" if len(before) > MOST_VALUES else ""
    return f"Not of the design as it is now. It had: {', '.join(texts)}{more}." if texts else ""


def shown(folders: Sequence[Path]) -> dict[str, object]:
    """Return the 3D view of results side by side, with the answer of one or the comparison of two.

    What is answered stands beside the view, and its figures below.

    Where one does not tell a figure, `longer` names it, and has how many times as long a simulation
    tells it, and this time as values of the design.

    Raises:
        InputError: a folder has no usable result, or the results cannot be compared.
    """
    longer: dict[str, object] = {}
    below: list[Section] = []
    html, content = parts_content(folders)
    results = [*map(load_result, folders)]
    is_alike = len({one.design.process.treatment_time for one in results}) == 1
    if not is_alike:
        texts = after_shorter_time(results, labels(folders))
        told = [Sentence(texts[0], "sentence"), Sentence(texts[1], "warning")]
        first = Section("Comparison", told, is_answer=True)
    elif len(folders) > 1:
        first = comparison_overview(compare(folders))
    else:
        (result,) = results
        first = answer_section(result, load_start(result))
        notes = notes_section(result)
        count = len(notes.content)
        below = [
            Section(notes.title, [Fold(f"Read {'it' if count == 1 else count}", notes.content)])
        ]
        if (times := times_longer(result)) > 1:
            now = result.design.process.accuracy.simulated_time_s
            longer = {
                "times": times,
                "values": {SIMULATED_TIME: float(f"{times * now:.4g}")},
                "tells": ", ".join(not_told(result.metrics)),
            }
    sentences = [one for one in first.content if isinstance(one, Sentence)]
    answers = [one for one in sentences if one.kind in ANSWERS or one.about == "process"]
    figures = [one for one in first.content if one not in answers]
    below = [*([Section("In figures", figures)] if figures else []), *below]
    above = section(replace(first, content=answers), viewer)
    more = "".join(section(one, viewer) for one in below)
    html = explained(f'<div class="told">{above}</div><div class="map">{html}</div>{more}')
    places = len(folders) > 1 and is_alike  # whether these can be compared
    return {"content": content, "html": html, "longer": longer, "places": places}


def difference(folders: Sequence[Path]) -> dict[str, str]:
    """Return the picture of where a later result covers more or less than the first, or why not.

    Raises:
        InputError: a folder has no usable result, or the results cannot be compared.
    """
    with private_folder() as place:
        picture = Path(place, "difference.png")
        if why := draw_differences(picture, compare(folders)):
            return {"why": why}
        return {"picture": f"data:image/png;base64,{b64encode(read_file(picture)).decode()}"}


ANSWERS = "sentence", "warning"  # kinds of sentences that stand above the view of a result
SIMULATED_TIME = "process.accuracy.simulated_time_s"
MOST_FILES = 20  # versions of the design's text that are kept for the pages that read them
STUDY_NAME = re.compile(r"\w[\w .+-]{0,100}\.toml")
COMMANDS = ("simulate", "run", "sweep")
PAPERS = {"report": [], "sheet": ["--sheet"]}  # options of the command `report`


class Acts:
    """The requests that the page of one design can make: a method for each address of the server.

    A request holds JSON values. Its value `read` is the digest of the design file's text that the
    page has read.

    Args:
        path: the design file.
        trusted: whether the chamber's shape in a design may be a Python file, which is then run.
        command: runs the commands that the page starts.
    """

    def __init__(self, path: Path, trusted: bool, command: OneCommand) -> None:
        self._path, self._trusted, self._command = path.resolve(), trusted, command
        self._files: dict[str, EditedFile] = {}
        first = self._read()
        self._picker, self._checker = Picker(), Checker(first.path)
        self._making = OneCommand()  # of a report or sheet, beside the other command

    def close(self) -> None:
        self._checker.stop()
        self._making.end()

    def read(self, _: object) -> dict[str, object]:
        """Return the design file as it is now, for a page that is opened or reloaded."""
        return self._as_read(self._read())

    def part(self, asked: object) -> bytes:
        return part_answer(preview_part(self._file(asked).design).mesh)

    def surface(self, asked: Any) -> bytes:
        """Return which triangles of the part are its surface of a name."""
        return surface_answer(preview_part(self._file(asked).design).mesh, str(asked["name"]))

    def shape(self, asked: Any) -> bytes:
        return shape_answer(
            self._file(asked).with_changes(asked["changes"]), int(asked.get("step", 0))
        )

    def fields(self, asked: Any) -> dict[str, object]:
        """Return numbers, choices, steps and picked surfaces of the design with its changes."""
        return _told_of(self._file(asked).changed(asked["changes"]))

    def structure(self, asked: Any) -> dict[str, object]:
        """Return changes after which the design has another shape or kind of holder."""
        file, name, wanted = self._file(asked), str(asked["name"]), str(asked["value"])
        changes = asked["changes"]
        own = file.with_steps(changes[KEPT]).design if KEPT in changes else file.design
        return restructured(own, changes, name, wanted, file.with_changes)

    def step(self, asked: Any) -> dict[str, object]:
        """Return changes after which the design has a further step."""
        changes, name = asked["changes"], str(asked["name"])
        design = self._file(asked).with_changes(changes)
        made = with_added_step(design, changes, name, int(asked["step"]))
        self._file(asked).with_changes(made)  # so that a wrong name is told at once
        return made

    def remove(self, asked: Any) -> dict[str, object]:
        """Return changes after which the design lacks one of its steps."""
        file, changes = self._file(asked), asked["changes"]
        count = len(file.with_changes(changes).steps or ())
        return without_step(file.design, changes, count, int(asked["step"]))

    def cavity(self, asked: Any) -> bytes:
        file = self._file(asked)
        design = file.with_changes(asked["changes"])  # so that a wrong value is told at once
        text, step = file.changed_text(asked["changes"]), int(asked.get("step", 0))
        # A drawn set-up has its part in a drawing with its walls, which the check reads itself.
        part = preview_part(design).mesh if design.chamber.setup() is None else None
        number, answer = self._checker.cavity(text, step, part)
        return number.to_bytes(4, "little") + answer

    def reach(self, asked: Any) -> bytes:
        return self._checker.reach(int(asked["number"]))

    def faces(self, asked: Any) -> bytes:
        """Return the number of the face to which each triangle of the part belongs."""
        mesh = preview_part(self._file(asked).design).mesh
        return packed({}, face=self._picker.faces(mesh, _border(asked)).of_triangle)

    def names(self, asked: Any) -> dict[str, object]:
        """Return the names of the faces of `faces` that have one, by the number of each."""
        mesh = preview_part(self._file(asked).design).mesh
        return {"names": face_names(mesh, self._picker.faces(mesh, _border(asked)).of_triangle)}

    def pick(self, asked: Any) -> dict[str, object]:
        design = self._file(asked).with_changes(asked["changes"])
        triangle, border = int(asked["triangle"]), _border(asked)
        if asked["act"] == "down":
            return self._picker.face_down(design, triangle, border)
        alike, add = bool(asked["alike"]), asked["act"] == "add"
        if asked["act"] == "face":
            return {"faces": [self._picker.face(design, triangle, border, alike)]}
        return self._picker.with_face(design, asked["table"], triangle, border, alike, add)

    def picked(self, asked: Any) -> bytes:
        """Return what a target lists face by face, or name by name, with areas and triangles."""
        design = self._file(asked).with_changes(asked["changes"])
        return picked_answer(preview_part(design).mesh, self._picker.picked(design, asked["table"]))

    def save(self, asked: Any) -> dict[str, object]:
        self._file(asked).save(asked["changes"])
        return self.read(None)

    def _read(self) -> EditedFile:
        file = EditedFile(self._path, self._trusted)
        if len(self._files) > MOST_FILES:
            self._files.clear()
        self._files[file.digest] = file
        return file

    def _file(self, asked: Any) -> EditedFile:
        """Return the design file in the version that the requesting page has read.

        Raises InputError if the page has to be reloaded.
        """
        file = self._files.get(str(asked["read"]))
        if file is None:
            raise InputError("this page has read an older file: reload it")
        return file

    def _as_read(self, file: EditedFile) -> dict[str, object]:
        design = file.design
        return {
            "read": file.digest,
            "file": file.path.name,
            "folder": str(file.folder),
            **_told_of(file),
            "chosen": {name: _chosen(design, name) for name in picked_surfaces(design)},
            "is_proposed": file.is_proposed,
            "is_calibrated": design.calibration is not None,
            "intensity": [on_page(text) for text in file.proposed_intensity],
            "of_matters": OF_MATTERS,
            "is_drawn": design.chamber.setup() is not None,
            "files": _files_beside(file.path),
            "aims": [(name, AIMS[name]) for name in _aims(design)],
            "figures": [
                (name, metric_label(name).with_unit)
                for name in metric_names(design)
                if "." not in name  # of the target, not of zones and steps
            ],
        }

    def study(self, asked: Any) -> dict[str, object]:
        """Write a study file beside the design, and remove it again if it is no valid study."""
        name, evaluations = str(asked["name"]).strip(), float(asked["evaluations"])
        name += "" if not name or name.endswith(".toml") else ".toml"
        if not STUDY_NAME.fullmatch(name):
            raise InputError(f"{name!r}: give a name of letters and digits")
        if not evaluations.is_integer():
            raise InputError(f"evaluations: given {evaluations:g}; give a whole number")
        file, path = self._file(asked), check_new_file(self.inside(name))
        bounds = {key: {"low": low, "high": high} for key, (low, high) in asked["vary"].items()}
        if not bounds:
            raise InputError("nothing varies: tick the numbers that the search may change")
        if (aim := str(asked["aim"])) not in _aims(file.design):
            raise InputError(f"{aim}: nothing that a search of this design can be after")
        start = {key: f"now {file.design.value(key):g}" for key in bounds}
        asked_for = file.design, bounds, start, int(evaluations), GOALS[aim]
        limits = _limits_text(asked.get("limits", ()))
        write_text(path, study_of_design(file.path.name, *asked_for) + limits)
        try:
            load_study(path)
        except InputError:
            remove_file(path)
            raise
        return {"study": path.name}

    def start(self, asked: Any) -> dict[str, object]:
        """Start a command of the command line.

        The command works on the saved design or on a study beside it. The answer has the folder of
        the result that it will leave, if any.
        """
        command, what = str(asked["command"]), self.inside(str(asked["of"]))
        if command not in COMMANDS:
            raise InputError(f"{command}: not a command of this page: {', '.join(COMMANDS)}")
        name = f"./{what.relative_to(self._path.parent).as_posix()}"
        self._refuse_shape(what)
        effort = str(asked.get("effort", AS_ASKED))
        if effort not in EFFORTS:
            raise InputError(f"{effort}: not an effort of this page: {', '.join(EFFORTS)}")
        scaled = [] if command != "simulate" or effort == AS_ASKED else [f"--effort={effort}"]
        sweeps = ["--sobol", str(int(asked["points"]))] if command == "sweep" else []
        own = f"-{effort}" if scaled else "-sweep" if sweeps else ""
        folder = self._free_folder(f"{what.stem}{own}")
        ranges = ["--no-ranges"] if not sweeps and asked.get("ranges") is False else []
        arguments = [command, name, *scaled, *sweeps, *ranges, "--out", folder]
        return self._command.start(arguments, self._path.parent, "" if sweeps else folder)

    def make(self, asked: Any) -> dict[str, object]:
        """Start to make the report or sheet of a result, also while another command runs."""
        what = self.inside(str(asked["of"])).relative_to(self._path.parent).as_posix()
        options = PAPERS[str(asked["paper"])]
        return self._making.start(["report", f"./{what}", *options], self._path.parent)

    def made(self, _: object) -> dict[str, object]:
        """Return how far the report or process sheet is that was begun last."""
        return self._making.status()

    def duration(self, asked: Any) -> dict[str, object]:
        """Return what is known before a design or study is simulated, for each effort it may take.

        `searched` is the folder of a search of the study, the newest; "" if there is none.
        """
        what = self.inside(str(asked["of"]))
        self._refuse_shape(what)
        folders = _result_folders(self._path.parent)
        known = foretold(what, folders, asked.get("ranges") is not False)
        return {"efforts": _efforts(known), "searched": self._searched(what, folders)}

    def tried(self, asked: Any) -> dict[str, object]:
        """Return how long a design will take, by a moment of it; nothing if that fails."""
        what = self.inside(str(asked["of"]))
        self._refuse_shape(what)
        return {"efforts": _efforts(tried(what, asked.get("ranges") is not False))}

    def _searched(self, file: Path, folders: Sequence[Path]) -> str:
        """Return the first of some folders in which a study was searched; "" for a design."""
        if not is_study(read_toml(file, "design")[1]):
            return ""
        study = load_study(file)
        for folder in filter(is_study_folder, folders):
            with suppress(InputError):
                inputs = read_inputs(folder)
                if inputs.plan is None and inputs.is_of(study):
                    return folder.relative_to(self._path.parent).as_posix()
        return ""

    def candidates(self, asked: Any) -> dict[str, object]:
        """Return the candidates of a study; only the version if the page has seen this one."""
        folder = self.inside(str(asked["folder"]))
        if asked.get("seen") == version(folder):
            return {"version": asked["seen"]}
        return candidates_answer(folder) | {"same": self._asking_the_same(folder)}

    def _asking_the_same(self, folder: Path) -> list[str]:
        """Return the other folders of studies that ask the same, of which one goes on with one."""
        inputs, found = read_inputs(folder), []
        for other in _result_folders(self._path.parent):
            with suppress(InputError):
                if other != folder and is_study_folder(other):
                    found += [other] if read_inputs(other).asks_as(inputs) else []
        return sorted(one.relative_to(self._path.parent).as_posix() for one in found)

    def candidate(self, asked: Any) -> dict[str, object]:
        folder, design = self.inside(str(asked["folder"])), self._file(asked).design
        return candidate_answer(folder, int(asked["number"]), design)

    def model(self, asked: Any) -> dict[str, Any]:
        folder = self.inside(str(asked["folder"]))
        if not (folder / STUDY).is_file():
            return {"reason": "There are no evaluations yet."}
        for name in _named_designs(self.inside(str(folder / STUDY))):
            self.inside(str(folder / name))
        self._refuse_shape(folder / STUDY)
        return model_answer(folder)

    def resume(self, asked: Any) -> dict[str, object]:
        """Start the command that goes on with the study or sweep of a folder."""
        folder = self.inside(str(asked["folder"]))
        name, out = f"./{self._study_of(folder)}", folder.relative_to(self._path.parent).as_posix()
        plan = read_inputs(folder).plan
        arguments = ["run", name]
        if plan is not None:
            seed = [] if plan.get("seed") is None else ["--seed", str(int(plan["seed"]))]
            method = {"grid": "--grid", "sobol": "--sobol"}[plan["method"]]
            arguments = ["sweep", name, method, str(int(plan["count"])), *seed]
        shows = "" if plan else out
        return self._command.start([*arguments, f"--out={out}"], self._path.parent, shows)

    def more(self, asked: Any) -> dict[str, object]:
        """Start a further study of the same question, which begins with the best so far.

        What a study asks for depends on its budget, so a study cannot get a larger one. The further
        study has points of its own.
        """
        folder = self.inside(str(asked["folder"]))
        before = self.inside(self._study_of(folder))
        path = write_further_study(before, folder, int(asked["evaluations"]))
        try:
            load_study(path)
        except InputError:
            remove_file(path)
            raise
        return self.start({"command": "run", "of": path.name})

    def _study_of(self, folder: Path) -> str:
        """Return the name of the study file beside the design that began in a folder."""
        inputs = read_inputs(folder)
        for row in _files_beside(self._path):
            if row["kind"] == "study":
                path = self.inside(row["name"])
                with suppress(InputError):
                    self._refuse_shape(path)
                    if inputs.is_of(load_study(path)):
                        return str(row["name"])
        raise InputError(
            f"{folder.name}: no study file here asks what this study asked, so its file or design "
            "was changed since; restore it, or run the study anew"
        )

    def _refuse_shape(self, file: Path) -> None:
        """Raise InputError if a design or study would run a Python file that is not trusted."""
        files = [file, *(file.parent / name for name in _named_designs(file))]
        tables = [read_toml(one, "design")[1] for one in files]
        shape = next(filter(None, map(custom_shape, tables)), "")
        if shape and not self._trusted:
            raise InputError(
                f"{file.name}: runs the Python file {shape}, which may do anything; start it from "
                "the command line, or begin again with --trust-shape"
            )

    def results(self, asked: Any) -> list[dict[str, object]]:
        file, changes = self._file(asked), asked["changes"]
        rows = list_results(self._path.parent, file.with_changes(changes))
        for row in rows:
            before = row.pop("before", {})
            with suppress(InputError):  # the page has no fields for some values
                file.with_changes(changes | before)
                row["back"] = before
        return rows

    def shown(self, asked: Any) -> dict[str, object]:
        return shown([self.inside(str(one)) for one in asked["folders"][:2]])

    def difference(self, asked: Any) -> dict[str, str]:
        return difference([self.inside(str(one)) for one in asked["folders"][:2]])

    def inside(self, name: str) -> Path:
        """Return the path of a name in the design's folder.

        Raises InputError if the path leads out of the folder.
        """
        return path_inside(self._path.parent, name)

    def _free_folder(self, name: str) -> str:
        """Return the first new or empty folder of results/NAME, results/NAME-2 and so on."""
        self.inside("results")  # the folder may be a link to elsewhere
        return free_folder(self._path.parent, Path("results", name))


def _efforts(known: Mapping[str, Foretold]) -> dict[str, object]:
    return {
        name: {"words": one.words, "few": on_page(one.few) if one.few else []}
        for name, one in known.items()
    }


def _border(asked: Any) -> Border:
    """Return what ends a face by what a page gives: no crease angle for a face of a CAD file."""
    if asked["crease_deg"] is None:
        return "cad_face"
    crease = float(asked["crease_deg"])
    if not 0.1 <= crease <= 180.0:
        raise InputError(f"crease angle: given {crease:g}; allowed: from 0.1 to 180 degrees")
    return crease


def _told_of(file: EditedFile) -> dict[str, object]:
    design = file.design
    return {
        "fields": design_fields(file),
        "surfaces": picked_surfaces(design),
        "steps": step_texts(design),
        "to_settle": [
            {
                "text": one,
                "urgency": matter.urgency.in_words,
                "mark": matter.mark.capitalize(),
                "words": on_page(matter.text),
                "takes": _taken(design, one),
                "meets": names_met(matter.text),
            }
            for matter, one in sorted(
                ((as_sentence(matter_of(one)), one) for one in design.to_settle),
                key=lambda both: both[0].urgency,
            )
        ],
    }


def _taken(design: Design, matter: str) -> list[dict[str, object]]:
    """Return words, and changes of a design, for balls and amplitudes that a matter names.

    With balls of another size their mass is another too, so that they lie in as many layers on the
    sonotrode. The list is empty for a design of several steps, or with balls of several sizes.
    """
    if design.steps or design.shot.diameter_mm is None:
        return []
    face = design.sonotrode
    key = f"sonotrode.{face.amplitude_key}"
    found: list[tuple[str, dict[str, float]]] = []
    for ball in balls_named(matter):
        mass = float(f"{design.shot.mass_g * ball / design.shot.diameter_mm:.2g}")
        changes = {"shot.diameter_mm": ball, "shot.mass_g": mass}
        found.append((f"balls of {ball:g} mm, {mass:g} g", changes))
    found += [
        (f"{one:g} µm zero-to-peak", {key: face.per_amplitude * one})
        for one in amplitudes_named(matter)
    ]
    return [{"label": f"take {text}", "changes": changes} for text, changes in found]


def _chosen(design: Design, table: str) -> dict[str, object]:
    """Return what the file says of a table that clicks on faces change."""
    first, *others = table.split(".")
    found: Any = getattr(design, first)
    for step in others:
        found = found[int(step)] if isinstance(found, tuple) else getattr(found, step, None)
    return {} if found is None else found.model_dump(mode="json", exclude_defaults=True)


def path_inside(folder: Path, name: str) -> Path:
    """Return the path of a name in a folder.

    Raises InputError if the path leads out of the folder.
    """
    path = (folder / name).resolve()
    if not path.is_relative_to(folder):
        raise InputError(f"{name}: outside the folder {folder.name}")
    return path


def free_folder(folder: Path, name: Path) -> str:
    """Return the first new or empty folder of NAME, NAME-2 and so on in a folder."""
    tried = (name.with_name(f"{name.name}-{k}") if k > 1 else name for k in count(1))
    return next(one for one in tried if is_new_or_empty(folder / one)).as_posix()


def _named_designs(file: Path) -> list[str]:
    """Return the design files that a study names; none for a design."""
    data = read_toml(file, "design")[1]
    if not is_study(data):
        return []
    first = data.get("begin_with")
    named = [data.get("design"), *(first if isinstance(first, list) else [])]
    return [one for one in named if isinstance(one, str)]


def _aims(design: Design) -> list[str]:
    """Return the objectives that a search of a design can be after, the usual one first."""
    return [
        name
        for name in GOALS
        if not any(metric_problem(design, term) for term in OBJECTIVES[name].terms)
    ]


def _files_beside(design: Path) -> list[dict[str, Any]]:
    """Return name, kind and words of each readable design or study file in a design's folder.

    The words say what a study is after, and `asks` has its question as far as the page can ask it.
    The design itself comes first.
    """
    rows: list[dict[str, Any]] = []
    for path in sorted(design.parent.glob("*.toml"), key=lambda one: (one != design, one.name)):
        with suppress(InputError):
            tables = read_toml(path, "design")[1]
            with suppress(AttributeError, TypeError):  # nonsense, which is told when it is run
                words = "this design" if path == design else "another design"
                kind = "study" if is_study(tables) else "design"
                words = aim_in_words(tables) if kind == "study" else words
                row = {"name": path.name, "kind": kind, "words": words}
                rows.append(row | ({"asks": _question(tables)} if kind == "study" else {}))
    return rows


def _question(tables: Mapping[str, Any]) -> dict[str, object]:
    """Return the aim of a study file, the ends of the numbers it varies, and its evaluations."""
    ends: dict[str, tuple[float, float]] = {}
    for name, one in tables.get("vary", {}).items():
        with suppress(ValueError):  # a form that the page has no field for
            varied = TypeAdapter(Vary).validate_python(one)
            ends |= {} if varied.texts else {name: varied.bounds}
    count = tables.get("optimizer", {}).get("evaluations")
    limits = [
        [name, metric_label(name).with_unit, side, metric_label(name).factor * float(one[side])]
        for name, one in tables.get("constraints", {}).items()
        for side in ("min", "max")
        if side in one
    ]
    aim = tables.get("objective", {}).get("name")
    return {"aim": aim, "vary": ends, "evaluations": count, "limits": limits}


def _limits_text(limits: Sequence[Any]) -> str:
    """Return the table of a study file with limits of figures; "" without limits.

    Args:
        limits: name of each figure, "min" or "max", and the limit in the unit of its label.

    Raises InputError if a limit is no number, or is given twice.
    """
    import tomlkit

    tables: dict[str, Any] = {}
    for name, side, value in limits:
        label = metric_label(str(name))
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"limit of {label.text}: given {value!r}; give a number")
        held = tables.setdefault(str(name), tomlkit.inline_table())
        if side not in ("min", "max") or side in held:
            raise InputError(f"limit of {label.text}: given twice; leave one out")
        held[side] = float(f"{value / label.factor:.10g}")
    return f"\n{tomlkit.dumps({'constraints': tables})}" if tables else ""
