"""The walls of the house, read from the sources: imports point one way, heavy libraries have one door."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

# Each line may import from the lines above it, and from its own line. A folder stands for all of its files.
CHAMBEROPT_ORDER = (
    ("errors", "diagnosis", "estimate", "materials", "mixture", "patches", "sight", "triangles", "uncovered"),
    ("disk", "fields", "remesh", "solids", "workers"),
    ("effects", "mesh_io", "shot", "slivers", "sonotrode", "treatment", "versions"),
    ("shapes",),
    ("design", "reach"),
    ("question",),
    ("config", "fittings", "target"),
    ("part",),
    ("chamber",),
    ("analytic", "coverage", "groups", "process"),
    ("checks", "hits", "objective", "replayed"),
    ("dents", "figures", "stuck"),
    ("dent_map", "flight_frames", "intensity", "replicas"),
    ("accuracy", "progress"),
    ("advice", "evaluation_file", "price", "quantities", "timeline"),
    ("viewer",),
    ("studies",),
    ("pictures",),
    ("price_list", "study_pictures"),
    ("results",),
    ("ground", "opened"),
    ("impacts",),
    ("comparing", "export", "maps", "report", "workbench"),
    ("cli",),
    ("__main__",),
)
SIM_CORE_ORDER = (
    ("errors", "_compile", "simd"),
    ("vec3", "stopwatch"),
    ("roots",),
    ("surfaces", "balls", "effects"),
    ("invariants", "nearest", "sizes"),
    ("packing",),
    ("physics",),
    ("flight",),
    ("detect", "resolve"),
    ("calendar", "blocks", "neighbours", "grounded", "impacts"),
    ("loop",),
    ("hits",),
    ("events",),
    ("pinches",),
    ("analytic_scene",),
    ("scene", "resting"),
    ("jams",),
    ("simulate",),
    ("warm_up",),
)
ORDER = {"chamberopt": CHAMBEROPT_ORDER, "sim_core": SIM_CORE_ORDER}
# Package fronts gather names for users and may import everything below them.
FRONTS = {"chamberopt/__init__.py", "sim_core/__init__.py"}
ONE_DOOR = {
    "sklearn": "studies/surrogate.py",
    "manifold3d": "solids.py",
    "nlopt": "studies/climb.py",
    "pyvista": "viewer/",
    "vtk": "viewer/",
    "distributed": "workers/cluster.py",
    "dask": "workers/cluster.py",
}
# VTK's file readers alone, which need no OpenGL.
ONE_DOOR["plotly"] = "report/"
ONE_DOOR["vtkmodules"] = "mesh_io/vtk_files.py"


def sources(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imports(path: Path) -> Iterator[tuple[str, tuple[str, ...], int]]:
    """(module, names taken from it, line) of every import statement, wherever in the file it stands."""
    tree = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, (), node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import; write the package's name"
            yield node.module or "", tuple(alias.name for alias in node.names), node.lineno


def rooms(module: str, names: tuple[str, ...]) -> list[str]:
    """The rooms of its package that an import reaches: `from sim_core import roots` reaches roots."""
    parts = module.split(".")
    return [parts[1]] if len(parts) > 1 else list(names)


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("package", ["chamberopt", "sim_core"])
def test_every_file_has_its_place_in_the_order(package: str) -> None:
    known = {room for line in ORDER[package] for room in line}
    homeless = {
        relative(path)
        for path in sources(package)
        if relative(path) not in FRONTS and path.relative_to(ROOT / package).parts[0].removesuffix(".py") not in known
    }
    assert not homeless, f"give these a line in {package}'s order: {sorted(homeless)}"


@pytest.mark.parametrize("package", ["chamberopt", "sim_core"])
def test_imports_point_one_way(package: str) -> None:
    level = {room: depth for depth, line in enumerate(ORDER[package]) for room in line}
    wrong = []
    for path in sources(package):
        if relative(path) in FRONTS:
            continue
        room = path.relative_to(ROOT / package).parts[0].removesuffix(".py")
        wrong += [
            f"{relative(path)}:{line}: {room} must not import {other}"
            for module, names, line in imports(path)
            if module.split(".")[0] == package
            for other in rooms(module, names)
            if other in level and room in level and level[other] > level[room]
        ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("package", ["chamberopt", "sim_core"])
def test_no_file_is_in_an_import_circle(package: str) -> None:
    """Files of one line may use one another, but never in a circle (type-only imports aside)."""
    graph: dict[str, set[str]] = {}
    names_of = {".".join(p.relative_to(ROOT).with_suffix("").parts): p for p in sources(package)}
    for name, path in names_of.items():
        reached = set()
        for module, names, _ in _run_time_imports(path):
            reached |= {m for m in (module, *(f"{module}.{n}" for n in names)) if m in names_of}
        graph[name.removesuffix(".__init__")] = reached - {name}
    done: set[str] = set()

    def visit(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, "circle: " + " -> ".join((*trail[trail.index(name) :], name))
        if name not in done:
            for other in graph.get(name, ()):
                visit(other, (*trail, name))
            done.add(name)

    for name in graph:
        visit(name, ())


def test_sim_core_knows_no_chamberopt() -> None:
    wrong = [
        f"{relative(path)}:{line}"
        for path in sources("sim_core")
        for module, _, line in imports(path)
        if module.split(".")[0] == "chamberopt"
    ]
    assert not wrong, f"sim_core must stay usable alone: {wrong}"


def test_chamberopt_sees_only_the_public_names_of_sim_core() -> None:
    wrong = [
        f"{relative(path)}:{line}: {module}"
        for path in sources("chamberopt")
        for module, _, line in imports(path)
        if module.startswith("sim_core.")
    ]
    assert not wrong, f"import from sim_core itself: {wrong}"


def test_chamberopt_imports_only_names_that_sim_core_offers() -> None:
    import sim_core

    offered = set(sim_core.__all__)
    wrong = [
        f"{relative(path)}:{line}: {name}"
        for path in sources("chamberopt")
        for module, names, line in imports(path)
        if module == "sim_core"
        for name in names
        if name not in offered
    ]
    assert not wrong, f"not in sim_core.__all__: {wrong}"


def test_nothing_imports_the_command_line() -> None:
    wrong = [
        f"{relative(path)}:{line}"
        for package in ("chamberopt", "sim_core")
        for path in sources(package)
        if path.name != "__main__.py" and path.parent.name != "cli"
        for module, names, line in imports(path)
        if module == "chamberopt.cli" or (module == "chamberopt" and "cli" in names)
    ]
    assert not wrong, wrong


@pytest.mark.parametrize("library", sorted(ONE_DOOR))
def test_heavy_libraries_have_one_door(library: str) -> None:
    doors = {
        relative(path)
        for package in ("chamberopt", "sim_core")
        for path in sources(package)
        for module, _, _ in imports(path)
        if module.split(".")[0] == library
    }
    assert all(door.startswith(f"chamberopt/{ONE_DOOR[library]}") for door in doors), doors


def test_the_only_compiler_of_sim_core_is_one_file() -> None:
    """A stray @njit would use numba's own cache, which misses edits in other files and answers wrongly."""
    wrong = [
        relative(path)
        for path in sources("sim_core")
        if path.name not in ("_compile.py", "simd.py")
        for module, _, _ in imports(path)
        if module.split(".")[0] == "numba"
    ]
    assert not wrong, f"use sim_core._compile.jit: {wrong}"


def _run_time_imports(path: Path) -> Iterator[tuple[str, tuple[str, ...], int]]:
    """The imports that happen when the file is loaded: not under TYPE_CHECKING, not inside a function."""
    tree = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    for node in tree.body:
        if isinstance(node, ast.Import):
            yield from ((alias.name, (), node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or "", tuple(alias.name for alias in node.names), node.lineno
