"""Make a release: `python release/make.py 0.2.0`. Nothing is published.

It sets the version, moves what CHANGELOG.md has under "Unreleased" under the version, builds wheel
and source archive in dist/, commits, and tags the commit. If a step fails, the files are as before.

The version stands in pyproject.toml, and is copied to two files whose readers look nowhere else.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tomllib
from datetime import date
from hashlib import sha256
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VERSION = re.compile(r"\d+\.\d+\.\d+")
UNRELEASED = "## Unreleased\n"
TO_FILL = "TO FILL"
# What is replaced in each file. A citation has the date beside the version.
PLACES = {
    "pyproject.toml": (r'^version = ".*"$', 'version = "{version}"'),
    "release/recipe.yaml": (r'^  version: ".*"$', '  version: "{version}"'),
    "CITATION.cff": (
        r"^version: .*$(\ndate-released: .*$)?",
        "version: {version}\ndate-released: '{day}'",
    ),
    "CHANGELOG.md": (f"^{UNRELEASED}", UNRELEASED + "\n## {version} ({day})\n"),
}


def main(arguments: list[str] | None = None, root: Path = ROOT) -> int:
    """Make the release of a clone, and return the exit status.

    Args:
        arguments: the version, by default from the command line.
        root: folder of the clone.
    """
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("version", help="such as 0.2.0, larger than the version before")
    version: str = parser.parse_args(arguments).version
    if wrong := _hindrance(version, root):
        print(f"{wrong}; nothing was changed", file=sys.stderr)
        return 2
    texts = {name: (root / name).read_text(encoding="utf-8") for name in PLACES}
    released = {name: _released(name, text, version) for name, text in texts.items()}
    try:
        for name, text in released.items():
            _write(root / name, text)
        archives = _build(version, root)
        _git(root, "commit", "--quiet", "--message", f"Release {version}", "--", *texts)
    except subprocess.CalledProcessError as error:
        for name, text in texts.items():
            _write(root / name, text)
        _git(root, "reset", "--quiet", "--", *texts)
        print(f"{error}\n{error.stderr or ''}nothing was changed", file=sys.stderr)
        return 1
    _git(root, "tag", "--annotate", f"v{version}", "--message", f"chamberopt {version}")
    print(f"chamberopt {version}: committed, and tagged v{version}")
    for archive in archives:
        print(f"{archive.relative_to(root)}  sha256 {sha256(archive.read_bytes()).hexdigest()}")
    for place in _left_to_fill(root):
        print(f"before an upload, {place}")
    print(f"Nothing was published. To take it back: git tag -d v{version}; git reset --hard HEAD~1")
    return 0


def _hindrance(version: str, root: Path) -> str | None:
    """Return why this version cannot be released, or None."""
    if not VERSION.fullmatch(version):
        return f"{version}: a version has three numbers, such as 0.2.0"
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    if _numbers(version) <= _numbers(project["version"]):
        return f"{version}: must be larger than {project['version']}, as pyproject.toml has it"
    if _git(root, "status", "--porcelain"):
        return "there are changes that are not committed: commit them or take them back"
    if _git(root, "tag", "--list", f"v{version}"):
        return f"v{version}: such a tag exists; give a larger version"
    changelog = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    _, found, unreleased = changelog.partition(UNRELEASED)
    if not found or not unreleased.partition("\n## ")[0].strip():
        return 'CHANGELOG.md: has nothing under "## Unreleased"; say there what a user gets'
    return None


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))


def _released(name: str, text: str, version: str) -> str:
    """Return the text of a file of PLACES with the version and today's date."""
    pattern, template = PLACES[name]
    new = template.format(version=version, day=date.today().isoformat())
    changed, count = re.subn(pattern, lambda _: new, text, count=1, flags=re.MULTILINE)
    if not count:
        raise SystemExit(f"{name}: has no line for the version ({pattern})")
    return changed


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def _build(version: str, root: Path) -> list[Path]:
    """Build wheel and source archive in an empty dist/, and return their paths."""
    shutil.rmtree(root / "dist", ignore_errors=True)
    build = [sys.executable, "-m", "hatchling", "build", "-d", "dist"]
    subprocess.run(build, cwd=root, check=True, capture_output=True, text=True)
    return sorted((root / "dist").glob(f"chamberopt-{version}*"))


def _left_to_fill(root: Path) -> list[str]:
    """Return a line for each place of the files of PLACES that nobody has filled yet."""
    return [
        f"fill {name}, line {number}: {line.partition(TO_FILL)[2].lstrip(': ')}"
        for name in PLACES
        for number, line in enumerate((root / name).read_text(encoding="utf-8").splitlines(), 1)
        if TO_FILL in line
    ]


def _git(root: Path, *arguments: str) -> str:
    """Return what a git command prints."""
    git = ["git", "-C", str(root), *arguments]
    return subprocess.run(git, check=True, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    raise SystemExit(main())
