"""How large the product is, and how far one of its facts is spread, counted from the sources.

    python benchmarks/counts.py [FOLDER ...]

Each folder is a checkout; without one, this one is counted. The counts are those of the packages
chamberopt and sim_core:

    tokens       of Python, without comments, docstrings and white space
    chain        files of the longest chain of imports that happen when a file is loaded
    tolerances   files, outside peening/ and design/, that name the tolerances of a result
    crease share files, outside the packages that compute it, that name the share of sharp edges
    estimates    types and literal dictionaries with both ends of an interval, low and high
    Any          share of the arguments and returns of functions that are of type Any
"""

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.table import print_table

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("chamberopt", "sim_core")
SPACE = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENCODING, tokenize.ENDMARKER,
}  # fmt: skip
TOLERANCES = re.compile(r"\.tolerances\b|\"tolerances\"|\btolerances_json\b|TolerancesRecord")
CREASES = re.compile(r"crease_share|\bcreases?\b")


class Sources:
    """The Python files of the product in a checkout, read and parsed once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.text = {
            path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8")
            for package in PACKAGES
            for path in sorted((folder / package).rglob("*.py"))
        }
        self.tree = {name: ast.parse(text) for name, text in self.text.items()}

    def counts(self) -> dict[str, object]:
        """Every count by its name."""
        lines = sum(text.count("\n") for text in self.text.values())
        tokens = sum(_tokens(text) for text in self.text.values())
        places = [Path(name) for name in self.text]
        folders = {place.parent for place in places}
        return {
            "lines": lines,
            "tokens": tokens,
            "tokens a line": round(tokens / lines, 2),
            "files without __init__": sum(place.name != "__init__.py" for place in places),
            "folders": len(folders),
            "levels below the package": max(len(place.parent.parts) for place in places) - 1,
            "entries of the fullest folder": max(map(self._entries, folders)),
            "chain": len(self.chain()),
            "tolerances": len(self._naming(TOLERANCES, ("peening", "design"))),
            "crease share": len(self._naming(CREASES, ("coverage", "simulation", "geometry"))),
            "estimates": sum(map(_estimate_forms, self.tree.values())),
            "Any [%]": round(100.0 * self._any_share(), 2),
        }

    def chain(self) -> tuple[str, ...]:
        """The longest chain of imports, from the file that imports all to the one that none."""
        modules = {_module(name): name for name in self.text}

        @cache
        def below(module: str) -> tuple[str, ...]:
            chains = [below(one) for one in _imported(self.tree[modules[module]], set(modules))]
            return (module, *max(chains, key=len, default=()))

        return max(map(below, modules), key=len)

    def _entries(self, folder: Path) -> int:
        return sum(one.name != "__pycache__" for one in (self.folder / folder).iterdir())

    def _naming(self, pattern: re.Pattern[str], computed_in: tuple[str, ...]) -> list[str]:
        return [
            name
            for name, text in self.text.items()
            if name.startswith("chamberopt/")
            and not {*Path(name).parts} & {*computed_in}
            and pattern.search(text)
        ]

    def _any_share(self) -> float:
        kinds = [kind for tree in self.tree.values() for kind in _annotations(tree)]
        return sum(bool(re.search(r"\bAny\b", kind)) for kind in kinds) / len(kinds)


def _tokens(text: str) -> int:
    """Tokens that are neither space nor comment nor a text that stands alone as a statement."""
    count, fresh = 0, True
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in SPACE:
            fresh = fresh or token.type != tokenize.COMMENT
            continue
        count += not (fresh and token.type == tokenize.STRING)
        fresh = False
    return count


def _module(name: str) -> str:
    return name.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _imported(tree: ast.Module, modules: set[str]) -> set[str]:
    """The product's own modules that are imported when a file is loaded."""
    found = set()
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in modules else node.module)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found & modules


def _annotations(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            kinds = [*(argument.annotation for argument in arguments), node.returns]
            yield from (ast.unparse(kind) for kind in kinds if kind is not None)


def _estimate_forms(tree: ast.Module) -> int:
    """Classes and literal dictionaries that have both ends of an interval."""
    ends, forms = {"low", "high"}, 0
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            fields = {
                one.target.id
                for one in node.body
                if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name)
            }
            forms += ends <= fields
        elif isinstance(node, ast.Dict):
            forms += ends <= {key.value for key in node.keys if isinstance(key, ast.Constant)}
    return forms


def main() -> None:
    folders = [Path(one).resolve() for one in sys.argv[1:]] or [ROOT]
    columns = [Sources(folder).counts() for folder in folders]
    names = [str(folder) for folder in folders]
    print_table(
        [
            {"count": name, **dict(zip(names, (one[name] for one in columns), strict=True))}
            for name in columns[0]
        ]
    )


if __name__ == "__main__":
    main()
