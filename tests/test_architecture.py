"""The structure, read from the sources.

Imports point one way, and each heavy library has one importer.
"""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

# Who may import whom: each package from those before it in its row, and from itself.
ORDER = {
    "chamberopt": (
        "common geometry design chamber coverage simulation peening search results pictures "
        "documents printers viewer workflows export page api cli __main__"
    ),
    "chamberopt/geometry": "triangles faces+heights+outline+solids+remesh+sight+thickness "
    "face_shapes meshes slivers+smoothing cut",
    "chamberopt/geometry/smoothing": "rounds normals divide smooth part fillets",
    "chamberopt/geometry/meshes": "surface_error native_reader+units+raw_mesh+self_intersection "
    "healing+elements+step_tessellation abaqus+gmsh+nastran+obj+ply+step+stl+threemf+vtk formats "
    "part_mesh",
    "chamberopt/design": (
        "shape_surface+table_base materials shapes effects+part+process+shot+sonotrode "
        "almen_strip+calibration+fixture+flexure+ranges+tolerances+zones design+intensity load"
    ),
    "chamberopt/chamber": (
        "replica_seed bores_and_deflectors thin_part part fixture+reach+largest_ball build "
        "dimensionless "
        "flexure+scene analytic shop+matters checks layout propose"
    ),
    "chamberopt/coverage": "dents part_impacts+metrics field coverage_from_impacts "
    "true_densities percentile coverage_intervals strength strength_intervals stress_law "
    "stress_model stress_knowledge stress_profile",
    "chamberopt/simulation": "resting_balls trapped_balls settling effort replicas evaluation "
    "estimates evaluate time_curve field_values variations advice effect_pilot+budget_pilot "
    "error_law numerical_parameters+timed_replicas convergence recommendation",
    "chamberopt/peening": "strip+calibration_errors kirk_fit+strip_holder held_strip+responses "
    "tolerance_result range_result tolerances+ranges+intensity_pilot measured probes virtual_strip "
    "posterior setups profile_fit calibrate next_measurement",
    "chamberopt/search": "study+optimiser trial_log study_folder "
    "sensitivity+observe+candidate judge ask_and_tell run_study pareto+run_sweep",
    "chamberopt/results": (
        "vtp_files records load arrays_file looked_places+shot_push write rebuild "
        "flight+impacts+impact_energy compare command_records"
    ),
    "chamberopt/pictures": "charts+quantities drawing camera drawn_part "
    "actors+overlay+subprocess_drawing view picture_page panels "
    "coverage+dents+difference+film+part+part3d comparison",
    "chamberopt/cli": "facts+interrupt+options+resume console prepare teller commands command_line",
    "sim_core": "errors numerics balls effects geometry motion impulses scene contact detect loop",
}
# Only these files or packages import the library.
ONE_IMPORTER: dict[str, str | tuple[str, ...]] = {
    "sklearn": "search/optimiser/gaussian_process.py",
    "manifold3d": "geometry/solids.py",
    "nlopt": "search/optimiser/nlopt_search.py",
    "pyvista": ("results/vtp_files.py", "api.py"),  # api.py for types alone
    "pandas": ("export/data_frames.py", "api.py"),  # api.py for types alone
    "vtk": ("pictures/", "viewer/"),
    "starlette": "page/",
    "uvicorn": "page/server.py",
    "distributed": "common/dask_cluster.py",
    "dask": "common/dask_cluster.py",
    # VTK's file readers alone, which need no OpenGL
    "vtkmodules": "geometry/meshes/vtk.py",
    "gmsh": "geometry/meshes/step_tessellation.py",
}
# Only the file layer touches files; here is what it cannot do for others, by file.
OPEN_METHODS = {
    "open", "read_text", "read_bytes", "write_text", "write_bytes", "unlink", "rename", "rmdir",
    "mkdir", "touch", "chmod", "symlink_to", "hardlink_to", "savetxt", "savez", "savez_compressed",
    "mkstemp", "mkdtemp", "NamedTemporaryFile", "TemporaryDirectory", "makedirs", "remove",
    "truncate", "link", "symlink", "rmtree", "move", "copyfile", "copy2", "copytree", "fdopen",
}  # fmt: skip
OPENED_ELSEWHERE = {
    "common/npz_files.py": {"np.savez", "np.savez_compressed"},  # into an open file, or memory
    # pipes, and a private folder that a child removes if its parent has ended
    "common/child.py": {"os.fdopen", "os.open", "shutil.rmtree"},
    # what the kernel tells of the machine, in files of its own
    "common/memory.py": {
        "Path('/proc/meminfo').read_text",
        "Path('/proc/self/cgroup').read_text",
        "(group / limit).read_text",
        "(group / used).read_text",
        "(group / 'memory.stat').read_text",
    },
    # a library in C++ reads a private file
    "geometry/meshes/step_tessellation.py": {"gmsh.open"},
}
MOST_ENTRIES = 20
UNREAD = "__pycache__", "py.typed"  # the latter is empty: it tells type checkers to look
COMPILER = ("jit.py", "step_compiler.py", "record_addresses.py", "simd.py", "compile_cache.py")


def sources(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


@cache
def imports(path: Path) -> tuple[tuple[str, tuple[str, ...], int], ...]:
    """(module, names taken from it, line) of every import statement anywhere in the file."""
    return tuple(_imports(path))


def _imports(path: Path) -> Iterator[tuple[str, tuple[str, ...], int]]:
    tree = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, (), node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, (
                f"{path}:{node.lineno}: relative import; write the package's name"
            )
            yield node.module or "", tuple(alias.name for alias in node.names), node.lineno


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def level_of(order: str) -> dict[str, int]:
    """Position of every name in a row; names joined by + share one."""
    return {name: level for level, group in enumerate(order.split()) for name in group.split("+")}


@pytest.mark.parametrize("package", ORDER)
def test_every_file_has_its_place_in_the_order(package: str) -> None:
    known = {*level_of(ORDER[package]), "__init__"}
    homeless = {
        path.stem
        for path in (ROOT / package).iterdir()
        if path.suffix == ".py" or (path / "__init__.py").is_file()
    } - known
    assert not homeless, f"give these a place in {package}'s row: {sorted(homeless)}"


@pytest.mark.parametrize("package", ORDER)
def test_imports_point_one_way(package: str) -> None:
    level, dotted = level_of(ORDER[package]), package.replace("/", ".")
    wrong = []
    for path in sources(package):
        own = path.relative_to(ROOT / package).parts[0].removesuffix(".py")
        if own == "__init__":  # gathers the names of its package for users
            continue
        for module, names, line in imports(path):
            reached = [f"{module}.{name}" for name in names] if module == dotted else [module]
            others = [
                one.removeprefix(f"{dotted}.").split(".")[0]
                for one in reached
                if one.startswith(f"{dotted}.")
            ]
            wrong += [
                f"{relative(path)}:{line}: {own} must not import {other}"
                for other in others
                if level.get(other, 0) > level[own]
            ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("package", ["chamberopt", "sim_core", "tests"])
def test_no_folder_is_crowded(package: str) -> None:
    crowded = {
        relative(folder): len(entries)
        for folder in (ROOT / package, *(ROOT / package).rglob("*"))
        if folder.is_dir() and folder.name != "__pycache__"
        for entries in [
            [e for e in folder.iterdir() if e.name not in UNREAD and not e.name.startswith(".")]
        ]
        if len(entries) > MOST_ENTRIES
    }
    assert not crowded, f"more than {MOST_ENTRIES} entries: {crowded}"


@pytest.mark.parametrize("package", ["chamberopt", "sim_core"])
def test_packages_are_at_most_two_levels_deep(package: str) -> None:
    deep = [relative(one) for one in sources(package) if len(one.relative_to(ROOT).parts) > 4]
    assert not deep


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
        if path.name != "__main__.py" and "cli" not in path.parts
        for module, names, line in imports(path)
        if module == "chamberopt.cli" or (module == "chamberopt" and "cli" in names)
    ]
    assert not wrong, wrong


@pytest.mark.parametrize("library", sorted(ONE_IMPORTER))
def test_heavy_libraries_have_one_importer(library: str) -> None:
    importers = {
        relative(path)
        for package in ("chamberopt", "sim_core")
        for path in sources(package)
        for module, _, _ in imports(path)
        if module.split(".")[0] == library
    }
    allowed = ONE_IMPORTER[library]
    places = (allowed,) if isinstance(allowed, str) else allowed
    wrong = {one for one in importers if not one.removeprefix("chamberopt/").startswith(places)}
    assert not wrong


def test_only_the_file_layer_touches_files() -> None:
    """What it opens follows no link into or out of a user's folders, and is written whole."""
    wrong = [
        f"{relative(path)}:{line}: {call}"
        for path in sources("chamberopt")
        if "common/files" not in relative(path)
        for call, line in _file_calls(path)
        if call not in OPENED_ELSEWHERE.get(relative(path).removeprefix("chamberopt/"), ())
    ]
    assert not wrong, "use chamberopt.common.files:\n" + "\n".join(wrong)


def _file_calls(path: Path) -> Iterator[tuple[str, int]]:
    """Each call that opens, makes, renames or removes a file, and its line."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        call = ast.unparse(node.func)
        name = call.rpartition(".")[2]
        # Path.replace has one argument; that of a text has two, that of a dataclass has names.
        is_renaming = name == "replace" and len(node.args) == 1 and not node.keywords
        if call in ("open", "os.replace") or (
            "." in call and (name in OPEN_METHODS or is_renaming)
        ):
            yield call, node.lineno


def test_the_only_compiler_of_sim_core_is_one_file() -> None:
    """A stray @njit would use numba's own cache.

    That cache misses edits in other files and then gives wrong results.
    """
    wrong = [
        relative(path)
        for path in sources("sim_core")
        if path.name not in COMPILER
        for module, _, _ in imports(path)
        if module.split(".")[0] == "numba"
    ]
    assert not wrong, f"use sim_core.numerics.jit.jit: {wrong}"


def _run_time_imports(path: Path) -> Iterator[tuple[str, tuple[str, ...], int]]:
    """The imports that happen when the file is loaded.

    Those under TYPE_CHECKING and inside functions are left out.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    for node in tree.body:
        if isinstance(node, ast.Import):
            yield from ((alias.name, (), node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or "", tuple(alias.name for alias in node.names), node.lineno
