"""Write the STEP files beside it, once: they are in the repository, and tests read them.

Run `python tests/helpers/eight_parts/make_step_files.py` where the package cadquery-ocp-novtk is
installed (made with 8.0.1.1.0). Lengths are in mm; the shaft's file states inches.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakePrism,
)
from OCP.collections import Array1_gp_Pnt
from OCP.GC import GC_MakeArcOfCircle
from OCP.GeomAbs import GeomAbs_Circle
from OCP.GeomAPI import GeomAPI_PointsToBSpline
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Vec
from OCP.Interface import Interface_Static
from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Shape
from OCP.XCAFDoc import XCAFDoc_ColorSurf, XCAFDoc_DocumentTool

RED, BLUE, GREEN, GREY = (1, 0, 0), (0, 0, 1), (0, 0.5, 0), (0.6, 0.6, 0.65)
Named = list[tuple[TopoDS_Shape, str]]  # faces or edges, and their names


def point(place: Iterable[float]) -> gp_Pnt:
    return gp_Pnt(*map(float, place))


def line(a: np.ndarray, b: np.ndarray) -> TopoDS_Shape:
    return BRepBuilderAPI_MakeEdge(point(a), point(b)).Edge()


def arc(a: np.ndarray, middle: np.ndarray, b: np.ndarray) -> TopoDS_Shape:
    curve = GC_MakeArcOfCircle(point(a), point(middle), point(b)).Value()
    return BRepBuilderAPI_MakeEdge(curve).Edge()


def spline(places: np.ndarray) -> TopoDS_Shape:
    array = Array1_gp_Pnt(1, len(places))
    for k, place in enumerate(places, start=1):
        array.SetValue(k, point(place))
    return BRepBuilderAPI_MakeEdge(GeomAPI_PointsToBSpline(array).Curve()).Edge()


def wire_of(edges: Named) -> tuple[TopoDS_Shape, Named]:
    """A wire, and its edges: copies of those given that share their ends."""
    maker, joined = BRepBuilderAPI_MakeWire(), []
    for edge, name in edges:
        maker.Add(edge)
        joined.append((maker.Edge(), name))
    return maker.Wire(), joined


def rounded(corners: np.ndarray, radii: np.ndarray, names: list[str]) -> Named:
    """Edges of a closed polygon (n, 2) at z = 0 whose corners are rounded.

    Args:
        names: (n,), of the side from each corner to the next; the arc at a corner has the name of
            the side after it.
    """
    before, after = np.roll(corners, 1, axis=0) - corners, np.roll(corners, -1, axis=0) - corners
    before, after = (v / np.linalg.norm(v, axis=1)[:, None] for v in (before, after))
    half = np.arccos((before * after).sum(axis=1)) / 2
    tangent = (radii / np.tan(half))[:, None]
    bisector = (before + after) / np.linalg.norm(before + after, axis=1)[:, None]
    middle = corners + bisector * (radii / np.sin(half) - radii)[:, None]
    flat = np.zeros((len(corners), 1))
    start, middle, end = (
        np.hstack([v, flat])
        for v in (corners + before * tangent, middle, corners + after * tangent)
    )
    edges: Named = []
    for k, name in enumerate(names):
        if radii[k]:
            edges.append((arc(start[k], middle[k], end[k]), name))
        edges.append((line(end[k], start[(k + 1) % len(names)]), name))
    return edges


def extrude(edges: Named, along: tuple[float, float, float]) -> tuple[TopoDS_Shape, Named]:
    """Solid over a closed profile, and its named faces."""
    wire, edges = wire_of(edges)
    face = BRepBuilderAPI_MakeFace(wire).Face()
    prism = BRepPrimAPI_MakePrism(face, gp_Vec(*along))
    sides = [(prism.Generated(edge).First(), name) for edge, name in edges]
    return prism.Shape(), [*sides, (prism.FirstShape(), "FRONT"), (prism.LastShape(), "REAR")]


def cut(solid: TopoDS_Shape, faces: Named, tool: TopoDS_Shape, name: str) -> tuple:
    """The solid less the tool; faces keep their names, and new ones get a name."""
    operation = BRepAlgoAPI_Cut(solid, tool)
    kept: Named = []
    for face, old in faces:
        if not operation.IsDeleted(face):
            kept += [(one, old) for one in operation.Modified(face)] or [(face, old)]
    known = [face for face, _ in kept]
    new = [(face, name) for face in faces_of(operation.Shape()) if face not in known]
    return operation.Shape(), [*kept, *new]


def faces_of(shape: TopoDS_Shape, kind: object = TopAbs_FACE) -> list[TopoDS_Shape]:
    explorer, found = TopExp_Explorer(shape, kind), []
    while explorer.More():
        if not any(explorer.Current().IsSame(one) for one in found):
            found.append(explorer.Current())
        explorer.Next()
    return found


def circles_of(shape: TopoDS_Shape) -> list[tuple[TopoDS_Shape, object]]:
    """The edges that are circles, and the circle of each."""
    edges = map(TopoDS.Edge, faces_of(shape, TopAbs_EDGE))
    curves = [(edge, BRepAdaptor_Curve(edge)) for edge in edges]
    return [(e, curve.Circle()) for e, curve in curves if curve.GetType() == GeomAbs_Circle]


def fir_tree_segment() -> tuple[TopoDS_Shape, Named]:
    """A sector of a turbine disc's rim with one slot of three lobes, broached at 8° to the axis."""
    half = np.array([
        (5.5, 2.0), (9.2, 5.0), (9.2, 6.3), (4.6, 9.0), (4.6, 10.2), (7.4, 12.4),
        (7.4, 13.6), (3.4, 16.0), (3.4, 17.2), (5.4, 19.0), (5.4, 22.5),
    ])  # fmt: skip
    rim = 150.0
    slot = np.r_[half, half[::-1] * [-1, 1]] * [1, -1] + [0, rim]
    mouth = np.array([[-6.5, np.sqrt(rim**2 - 6.5**2)], [6.5, np.sqrt(rim**2 - 6.5**2)]])
    a = np.radians(10.0)
    outer, inner = (r * np.array([np.sin(a), np.cos(a)]) for r in (rim, 112.0))
    mirrored = np.array([-1, 1])
    corners = np.array(
        [*slot, mouth[0], outer * mirrored, inner * mirrored, inner, outer, mouth[1]]
    )
    n = len(slot)
    names = [*["FIR_TREE"] * n, "RIM", "SIDE", "BORE", "SIDE", "RIM", "FIR_TREE"]
    radii = np.r_[np.full(n, 1.0), np.zeros(6)]
    radii[[10, 11]], radii[[0, n - 1]] = 3.0, 2.0
    edges = rounded(corners, radii, names)
    for k in (-6, -4, -2):  # rim, bore and rim are arcs, not lines
        first, last = {-6: (-6, -5), -4: (-4, -3), -2: (-2, -1)}[k]
        p, q = corners[first], corners[last]
        middle = (p + q) / np.linalg.norm(p + q) * np.linalg.norm(p)
        edges[k] = (arc(*(np.r_[v, 0.0] for v in (p, middle, q))), edges[k][1])
    return extrude(edges, (26 * np.tan(np.radians(8.0)), 0.0, 26.0))


def helical_gear() -> tuple[TopoDS_Shape, Named]:
    """23 teeth of normal module 2.5 mm, helix angle 20°, with a bore and a keyway."""
    teeth, width, helix = 23, 18.0, np.radians(20.0)
    module = 2.5 / np.cos(helix)
    pitch = module * teeth / 2
    pressure = np.arctan(np.tan(np.radians(20.0)) / np.cos(helix))
    base, tip, root = pitch * np.cos(pressure), pitch + 2.5, pitch - 3.1
    low = max(base, root + 0.9)
    involute = lambda r: np.tan(np.arccos(base / r)) - np.arccos(base / r)  # noqa: E731
    radius = np.linspace(low, tip, 7)
    angle = np.pi / 2 / teeth + involute(pitch) - involute(radius)  # half of the tooth

    def at(radii: np.ndarray, angles: np.ndarray, z: float) -> np.ndarray:
        return np.stack([radii * np.cos(angles), radii * np.sin(angles), z + 0 * radii], axis=-1)

    def section(z: float) -> Named:
        turn, edges = z * np.tan(helix) / pitch, []
        for tooth in range(teeth):
            middle = turn + 2 * np.pi * tooth / teeth
            left, right = at(radius, middle + angle, z), at(radius, middle - angle, z)
            gap = middle + np.pi / teeth
            bottom = at(np.array(root), np.array(gap), z)
            top = at(np.array(tip), np.array(middle), z)
            after = at(radius[:1], 2 * gap - middle - angle[:1], z)[0]
            edges += [
                (spline(right), "FLANK"), (arc(right[-1], top, left[-1]), "TIP"),
                (spline(left[::-1]), "FLANK"), (arc(left[0], bottom, after), "ROOT"),
            ]  # fmt: skip
        return edges

    loft = BRepOffsetAPI_ThruSections(True, False, 1e-4)
    wires = [wire_of(section(z)) for z in (0.0, width / 2, width)]
    for wire, _ in wires:
        loft.AddWire(wire)
    loft.CheckCompatibility(False)
    loft.Build()
    sides = [(loft.GeneratedFace(edge), name) for edge, name in wires[0][1]]
    ends = [(loft.FirstShape(), "FRONT"), (loft.LastShape(), "REAR")]
    bore = BRepPrimAPI_MakeCylinder(10.0, width).Shape()
    solid, faces = cut(loft.Shape(), [*sides, *ends], bore, "BORE")
    key = BRepPrimAPI_MakeBox(gp_Pnt(0, -3, 0), gp_Pnt(12.8, 3, width)).Shape()
    return cut(solid, faces, key, "KEYWAY")


def knee_tray() -> tuple[TopoDS_Shape, Named]:
    """The tibial tray of a knee: a kidney-shaped plate with a rim, and a stem below."""
    around = np.linspace(0.0, 2 * np.pi, 25)
    outline = np.c_[37 * np.cos(around), 24 * np.sin(around) + 7 * np.cos(2 * around), 0 * around]
    solid, faces = extrude([(spline(outline), "RIM")], (0.0, 0.0, 6.0))
    inside = np.c_[outline[:, :2] * 0.88, np.full(25, 3.5)]
    pocket, _ = extrude([(spline(inside), "POCKET")], (0.0, 0.0, 10.0))
    solid, faces = cut(solid, faces, pocket, "POCKET")
    stem = BRepPrimAPI_MakeCone(gp_Ax2(gp_Pnt(0, -3, 0.0), gp_Dir(0, 0, -1)), 8.0, 5.5, 34.0)
    whole = BRepAlgoAPI_Fuse(solid, stem.Shape()).Shape()
    fillet = BRepFilletAPI_MakeFillet(whole)
    for edge, circle in circles_of(whole):
        fillet.Add(4.0 if circle.Radius() > 7 else 2.5, edge)
    whole = fillet.Shape()
    return whole, [(f, "UNDER" if below(f) else "OVER") for f in faces_of(whole)]


def below(face: TopoDS_Shape) -> bool:
    """Whether a face of the tray is on the side of the stem, which is grit blasted or peened."""
    box = Bnd_Box()
    BRepBndLib.Add_s(face, box)
    return box.CornerMax().Z() < 1.0


def stepped_shaft() -> list[tuple[TopoDS_Shape, Named, str]]:
    """A shaft of three diameters with rounded shoulders and a keyway, and the key, a tight fit."""
    shaft = None
    for radius, start, end in ((12.7, 0, 30), (19.05, 30, 66), (15.0, 66, 96)):
        axis = gp_Ax2(gp_Pnt(0, 0, start), gp_Dir(0, 0, 1))
        step = BRepPrimAPI_MakeCylinder(axis, radius, float(end - start)).Shape()
        shaft = BRepAlgoAPI_Fuse(shaft, step).Shape() if shaft else step
    fillet = BRepFilletAPI_MakeFillet(shaft)
    for edge, circle in circles_of(shaft):
        if 29 < circle.Location().Z() < 67 and circle.Radius() < 19:
            fillet.Add(2.5, edge)
    shaft = fillet.Shape()
    faces = [(face, "SHAFT") for face in faces_of(shaft)]
    slot = BRepPrimAPI_MakeBox(gp_Pnt(8.7, -4, 6), gp_Pnt(20, 4, 24)).Shape()
    shaft, faces = cut(shaft, faces, slot, "KEYWAY")
    key = BRepPrimAPI_MakeBox(gp_Pnt(8.6, -4.01, 5.99), gp_Pnt(16.7, 4.01, 24.01)).Shape()
    return [(shaft, [(f, n) for f, n in faces if n == "KEYWAY"], "SHAFT"), (key, [], "KEY")]


def write(
    path: Path,
    bodies: list[tuple[TopoDS_Shape, Named, str]],
    colours: dict[str, tuple[float, ...]],
    names: bool,
    unit: str = "MM",
) -> None:
    """Write bodies with their named faces; colours are by the name of a face, "" for the body."""
    document = TDocStd_Document(TCollection_ExtendedString("BinXCAF"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    paint = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    text = TCollection_ExtendedString
    root = shapes.NewShape() if len(bodies) > 1 else None
    for solid, faces, title in bodies:
        label = shapes.AddShape(solid, False)
        TDataStd_Name.Set_s(label, text(title))
        if "" in colours:
            paint.SetColor(
                label, Quantity_Color(*colours[""], Quantity_TOC_sRGB), XCAFDoc_ColorSurf
            )
        for face, name in faces:
            part = shapes.AddSubShape(label, face)
            if names:
                TDataStd_Name.Set_s(part, text(name))
            if name in colours:
                colour = Quantity_Color(*colours[name], Quantity_TOC_sRGB)
                paint.SetColor(part, colour, XCAFDoc_ColorSurf)
        if root:
            placed = shapes.AddComponent(root, label, TopLoc_Location())
            TDataStd_Name.Set_s(placed, text(title))
    shapes.UpdateAssemblies()
    if root:
        TDataStd_Name.Set_s(root, text(path.stem.upper()))
    writer = STEPCAFControl_Writer()  # knows its settings only from here on
    Interface_Static.SetCVal_s("write.step.unit", unit)
    Interface_Static.SetIVal_s("write.stepcaf.subshapes.name", 1)
    Interface_Static.SetIVal_s("write.surfacecurve.mode", 0)
    writer.SetNameMode(True)
    writer.SetColorMode(True)
    writer.Transfer(document)
    writer.Write(str(path))
    lines = re.sub(r"'\d{4}-\d\d-\d\dT[\d:]+'", "'2026-01-01T00:00:00'", path.read_text())
    path.write_text(lines)
    print(f"{path.name}: {1e-3 * path.stat().st_size:.0f} kB")


def main(folder: Path) -> None:
    write(
        folder.parents[2] / "designs/parts/fir_tree.step",
        [(*fir_tree_segment(), "DISC_SEGMENT")],
        {"": GREY, "FIR_TREE": RED, "RIM": GREEN},
        names=True,
    )
    write(
        folder / "helical_gear.step",
        [(*helical_gear(), "GEAR")],
        {"FLANK": BLUE, "ROOT": BLUE},
        names=False,
    )
    write(folder / "knee_tray.step", [(*knee_tray(), "TRAY")], {"UNDER": RED}, names=False)
    write(folder / "stepped_shaft.step", stepped_shaft(), {}, names=False, unit="INCH")


if __name__ == "__main__":
    main(Path(__file__).parent)
