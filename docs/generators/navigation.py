"""The list of pages beside each page: a group for each kind of page, in the order of a reader."""

from pathlib import Path

DOCS = Path(__file__).parents[1]
# Each kind of page is a folder of docs/. Pages that are not named follow in alphabetical order.
KINDS = {
    "tutorials": ("Tutorials", ["tutorial", "peening_examples"]),
    "how_to": ("How-to guides", ["propose", "page", "parts", "chambers", "setups", "study"]),
    "reference": ("Reference", ["commands", "design", "study_file", "shop", "measurements"]),
    "explanation": ("Explanation", ["proposal", "peening", "accuracy", "validation"]),
}
PROJECT = {
    "What the program can do": "../README",
    "Gallery": "gallery",
    "Changes": "../CHANGELOG",
    "Working on it": "../CONTRIBUTING",
}


def section() -> str:
    """Return the lists of pages as MyST text that shows nothing on the page itself."""
    lists = []
    for folder, (caption, first) in KINDS.items():
        names = sorted(path.stem for path in (DOCS / folder).glob("*.md"))
        names = sorted(names, key=lambda name: first.index(name) if name in first else len(first))
        lists.append(_toctree(caption, [f"{folder}/{name}" for name in names]))
    about = [f"{title} <{page}>" for title, page in PROJECT.items()]
    return "\n".join([*lists, _toctree("The project", about)])


def _toctree(caption: str, entries: list[str]) -> str:
    return "\n".join(
        [
            "```{toctree}",
            ":hidden:",
            ":titlesonly:",
            ":maxdepth: 1",
            f":caption: {caption}",
            "",
            *entries,
            "```",
            "",
        ]
    )
