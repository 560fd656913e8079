"""The command `example`: copy a shipped design, its part and a study, to try the program with."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from chamberopt.cli.console import show
from chamberopt.cli.options import Out, app

CAD_FILE = "fir_tree"  # has no design; `chamberopt new` proposes it
STUDIES = {"gear": "quickstart", "plate": "plate", "blade": "blade"}  # study file of each example


@app.command
def example(name: Literal["gear", "plate", "blade", "fir_tree"], /, *, out: Out = None) -> None:
    """Write a shipped design, its part and a study of it into a folder, by default ./NAME.

    Parameters
    ----------
    name
        A pinion on its shaft, a plate that closes the chamber, a compressor blade; or fir_tree,
        a STEP file alone, for docs/tutorials/tutorial.md.
    """
    from chamberopt.common.files import (
        claim_folder,
        make_folder,
        read_file,
        write_bytes,
        write_text,
    )
    from chamberopt.common.shipped import shipped_files

    shipped = shipped_files()
    if name == CAD_FILE:
        with claim_folder(out or Path(name)) as folder:
            step = shipped / f"designs/parts/{name}.step"
            write_bytes(folder / step.name, read_file(step, follow=True))
        shown = [f"{folder}: {step.name}", "to go on:", f"  cd {folder}"]
        show([*shown, f"  chamberopt new {step.name} --target FIR_TREE --out chamber"])
        return
    design, study = f"{name}.toml", f"{name}_study.toml"
    with claim_folder(out or Path(name)) as folder:
        part = make_folder(folder / "parts") / f"{name}.stl"
        write_bytes(part, read_file(shipped / f"designs/parts/{name}.stl", follow=True))
        write_bytes(folder / design, read_file(shipped / f"designs/{name}.toml", follow=True))
        text = read_file(shipped / f"studies/{STUDIES[name]}.toml", follow=True).decode()
        write_text(folder / study, text.replace("../designs/", ""))
    show(
        [
            f"{folder}: {design}, {study} and {part.relative_to(folder).as_posix()}",
            "to go on:",
            f"  cd {folder}",
            f"  chamberopt check {design}",
            f"  chamberopt run {study}",
            f"  chamberopt report results/{name}_study",
        ]
    )
