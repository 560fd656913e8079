"""The designs, parts and studies that come with the program."""

from __future__ import annotations

from pathlib import Path


def shipped_files() -> Path:
    """Return the folder of the shipped designs/ and studies/.

    It is in the installed package, or else at the root of a source checkout.
    """
    import chamberopt

    package = Path(chamberopt.__file__).parent
    examples = package / "examples"
    return examples if examples.is_dir() else package.parent
