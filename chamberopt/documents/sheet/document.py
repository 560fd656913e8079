"""Compose a process sheet of a result: what an operator sets, expects and measures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from chamberopt.documents.answer import answer
from chamberopt.documents.document import Block, Document, Section, Sentence, Table
from chamberopt.documents.sheet.acceptance import acceptance_rows, strip_rows
from chamberopt.documents.sheet.expected import calibrated_to, expected_rows, first_checks
from chamberopt.documents.sheet.rows import AsBuilt, Row
from chamberopt.documents.sheet.settings import (
    chamber_rows,
    part_rows,
    run_rows,
    shot_rows,
    sonotrode_rows,
    step_rows,
)
from chamberopt.documents.sheet.warned import (
    alarms,
    cautions,
    matter_tables,
    tolerance_rows,
    unusual_intensity,
    warning_rows,
    wide_face,
    zone_rows,
)
from chamberopt.results.load import load_start

if TYPE_CHECKING:
    from chamberopt.results.load import Result

DIGEST = 12  # characters of a digest in the title block
REVISION = "revision"
TO_FILL = ("drawing no.", REVISION, "drawn by, date", "checked by, date", "set up by, date")
DESIGN_OF = {
    "study": "best.toml",
    "simulation": "design.toml",
}  # file of the sheet's design, by kind
REQUALIFY = (
    "Requalify after: another sonotrode, chamber, holder, lot of parts or balls; a number out of "
    "tolerance; a program version that moved figures."
)
SHEETS_OF = {
    "study": "The best chamber of a study, confirmed on fresh seeds",
    "simulation": "One simulated chamber",
}


def process_sheet(result: Result, built: AsBuilt, revision: str = "") -> Document:
    """Return the process sheet of a result as a document.

    Without a revision its field is left to be filled in.

    Its sections are the first page, with sentences of the kind "warning" for the top; tables that
    may go on further pages; and the title block, where a name without a value is to be filled in.

    """
    record = result.record
    start = load_start(result)
    checks, calibrated = first_checks(result, built.held), calibrated_to(result)
    reasons = (
        *alarms(result),
        *unusual_intensity(result, built.usual),
        *wide_face(result, built.face_mm),
    )
    red = [Sentence(text, "warning") for text in reasons]
    requalify = Sentence(REQUALIFY)
    content: list[Block] = [*red, *setting_tables(result, built), checks, *calibrated, requalify]
    name = f"{result.design.part.mesh_path.name}: {result.folder.resolve().name}"
    fields = title_block(result, name) | ({REVISION: revision} if revision else {})
    block = Table("", (), [*fields.items()], numbers=False)
    return Document(
        name,
        f"{SHEETS_OF[record.kind]}; simulated {record.created[:10]}",
        answer(result, start, tells_aim=False),
        (),
        [
            Section("Process sheet", content),
            Section("Measurements, limits and warnings", limit_tables(result, built)),
            Section("Title block", [block]),
        ],
    )


def title_block(result: Result, name: str) -> dict[str, str]:
    """Return the fields of the title block. Those without a value are for the shop to fill in."""
    record = result.record
    return {
        "design": name,
        "chamberopt, simulated": f"{record.versions['chamberopt']}, {record.created[:10]}",
        "replicas, first seed": f"{record.replicas}, {result.seeds[0]}",
        "part, sha256": record.part_sha256[:DIGEST],
        "design, sha256": design_sha256(result)[:DIGEST],
        "result, sha256": record.sha256[:DIGEST],
        **dict.fromkeys(TO_FILL, ""),
    }


def design_sha256(result: Result) -> str:
    """Return the digest of the file of the sheet's design in the results folder."""
    return result.record.files.get(DESIGN_OF[result.record.kind], "")


def setting_tables(result: Result, built: AsBuilt) -> list[Table]:
    """Return tables on the part, the chamber, its settings and the figures to expect.

    A row with an empty name holds a sentence.
    """
    return _tables([
        ("Part and pose", part_rows(result, built)),
        ("Chamber", chamber_rows(result, built)),
        ("Sonotrode", sonotrode_rows(result, built.face_mm)),
        ("Shot", shot_rows(result)),
        ("Steps", step_rows(result, built)),
        ("To peen a part", run_rows(result, built)),
        ("Acceptance", acceptance_rows(result, built)),
        ("Peening, and what to expect", expected_rows(result, built.usual)),
    ])  # fmt: skip


def limit_tables(result: Result, built: AsBuilt) -> list[Table]:
    """Return tables on how strips are held, limits, tolerances, and all that is warned of."""
    return _tables([
        ("Strip holder", strip_rows(built)),
        *matter_tables(result),
        ("Zones and limits", zone_rows(result)),
        ("Tolerances", tolerance_rows(result, built.openings)),
        ("Not in these figures", (("", text) for text in cautions(result))),
        ("Warnings", warning_rows(result)),
    ])  # fmt: skip


def _tables(found: Sequence[tuple[str, Iterator[Row]]]) -> list[Table]:
    """Return tables of names and values, without those that have no row."""
    tables = [Table(title, (), [*rows], numbers=False) for title, rows in found]
    return [one for one in tables if one.rows]
