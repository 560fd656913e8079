"""The command `strip`: simulate the arc heights of an Almen strip."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from chamberopt.cli import console
from chamberopt.cli.options import Cluster, Json, Out, Verbose, Workers, app
from chamberopt.common.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from chamberopt.design.load import Design
    from chamberopt.peening.strip import StripSize

LEAST_MM, MOST_MM = 2.0, 2000.0


@app.command
def strip(
    design: Path,
    /,
    *,
    strip_type: Annotated[Literal["A", "N", "C"], Parameter(name="--type")] = "A",
    at: str = "lid",
    distance_mm: float | None = None,
    disc_mm: float | None = None,
    size_mm: Annotated[tuple[float, float] | None, Parameter(negative="")] = None,
    workers: Workers = None,
    cluster: Cluster = None,
    json: Json = False,
    out: Out = None,
    verbose: Verbose = False,
) -> None:
    """Peen a virtual Almen strip: its saturation curve, intensity and saturation time.

    The replicas are those of the design's process.accuracy. Without a calibration the design has
    no intensity in mmA: heights are peening strengths, which compare designs.

    Parameters
    ----------
    design
        Design file (.toml).
    strip_type
        Thickness of the strip.
    at
        lid: the strip closes the chamber in place of the part; or a zone of the part, in whose
        place it stands.
    distance_mm
        From the sonotrode to the strip, by default as to the part.
    disc_mm
        Diameter of a round strip, where a whole one does not fit.
    size_mm
        Length and width of a small strip.
    """
    from chamberopt.cli.teller import TerminalTeller
    from chamberopt.common.executor import open_executor
    from chamberopt.design.load import load_design
    from chamberopt.design.zones import LID
    from chamberopt.documents.terminal_lines import strip_end
    from chamberopt.workflows.strip import StripPlace, peen_strip_in

    place = StripPlace(strip_type, at, _size(disc_mm, size_mm), distance_mm)
    loaded = load_design(design)
    if at != LID:
        _require_zone(at, loaded, {"--distance-mm": distance_mm, "--disc-mm": disc_mm,
                                   "--size-mm": size_mm})  # fmt: skip
    with (
        console.results_folder(out, f"{design.stem}-strip") as folder,
        open_executor(workers, cluster) as executor,
    ):
        peened, advice = peen_strip_in(loaded, place, folder, executor, TerminalTeller())
    end = strip_end(peened, map(str, advice), verbose)
    console.print_result(end, folder, json, "strip.json")


def _size(disc_mm: float | None, size_mm: tuple[float, float] | None) -> StripSize:
    """Return the size of the Almen strip: a disc's diameter, or length and width [mm].

    Raises InputError if both are given or a number is out of range.
    """
    from chamberopt.peening.strip import StripSize

    if disc_mm is not None and size_mm is not None:
        raise InputError("--size-mm: given beside --disc-mm; give one of them")
    given = [("--disc-mm", disc_mm), *(("--size-mm", one) for one in size_mm or ())]
    for option, value in given:
        if value is not None and not LEAST_MM <= value <= MOST_MM:
            allowed = f"from {LEAST_MM:g} to {MOST_MM:g} mm"
            raise InputError(f"{option}: given {value:g}; allowed: {allowed}")
    if disc_mm is not None:
        return StripSize(1e-3 * disc_mm, 1e-3 * disc_mm, is_disc=True)
    return StripSize() if size_mm is None else StripSize(1e-3 * size_mm[0], 1e-3 * size_mm[1])


def _require_zone(at: str, design: Design, of_lids: Mapping[str, object]) -> None:
    """Raise InputError if the design lacks the zone `at`, in which a strip is to stand.

    Also raise InputError if an option of `of_lids` is given, which is only for a strip in the lid.
    """
    from chamberopt.design.zones import LID

    names = [zone.name for zone in design.zones]
    if at not in names:
        allowed = ", ".join([LID, *names])
        without = "" if names else ", or a zone once the design has some as [[zones]]"
        raise InputError(f"--at: given {at!r}; allowed: {allowed}{without}")
    for option, value in of_lids.items():
        if value is not None:
            raise InputError(f"{option}: given beside --at {at}; it is for --at {LID} alone")
