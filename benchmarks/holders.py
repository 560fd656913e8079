"""Draw a rod, a collar and a block as holders, with masks: docs/images/holders.png.

    python benchmarks/holders.py

The parts are those of designs/, in chambers that suit the holder.
"""

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from chamberopt.chamber.build import build_chamber
from chamberopt.design.design import Design, validate
from chamberopt.design.load import load_design
from chamberopt.pictures.drawing.chamber import draw_chamber

ROOT = Path(__file__).resolve().parents[1]
WIDE, TALL = 160.0, 76.0  # mm on the page, of each drawing
SHAFT = {"direction": (0, 0, 1), "angle_deg": (80, 100), "radius_mm": (6, 9)}
END_FACES = {"direction": (0, 0, 1), "angle_deg": (0, 10), "box_mm": ((-23, -23, 9), (23, 23, 11))}
CASES: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "A rod on the end of the shaft holds the gear": (
        "gear",
        {"height_mm": 105.0},
        {"holder": {"kind": "rod"}},
    ),
    "A collar grips 5 mm of the shaft; a mask 1.5 mm thick covers an end face": (
        "gear",
        {},
        {
            "holder": {"kind": "collar", "at": SHAFT, "grip_mm": 5.0},
            "mask": {"at": END_FACES, "thickness_mm": 1.5},
        },
    ),
    "A plate grips 7 mm of the blade: a block round its root": (
        "blade",
        {"height_mm": 75.0},
        {"holder": {"kind": "plate", "grip_mm": 7.0}},
    ),
}


def held(name: str, sizes: dict[str, Any], fixtures: dict[str, Any]) -> Design:
    data = load_design(ROOT / "designs" / f"{name}.toml").model_dump()
    data["chamber"] |= sizes
    return validate(Design, {**data, **fixtures})


def main() -> None:
    page = WIDE, TALL * len(CASES)
    figure = Figure(figsize=(page[0] / 25.4, page[1] / 25.4), dpi=150)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, page[0]), ylim=(0.0, page[1]))
    axes.axis("off")
    for number, (title, case) in enumerate(CASES.items()):
        top = page[1] - TALL * number
        axes.text(3.0, top - 2.0, title, size=8.0, va="top")
        draw_chamber(axes, build_chamber(held(*case)), 3.0, top - 5.0, (WIDE - 6.0, TALL - 6.0))
    axes.text(3.0, 2.0, "lengths in mm", size=7.0, color="#56616a")
    figure.savefig(ROOT / "docs" / "images" / "holders.png")


if __name__ == "__main__":
    main()
