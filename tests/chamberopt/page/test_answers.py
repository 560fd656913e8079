"""What the page is told of a part, in the bytes that it takes apart."""

import json
from pathlib import Path

import numpy as np

from chamberopt.chamber.part import preview_part
from chamberopt.page.answers import part_answer
from tests.chamberopt.chamber.test_target import design_of


def test_each_triangle_has_the_number_of_its_name(tmp_path: Path) -> None:
    design = design_of(tmp_path, {})
    answer = part_answer(design)
    begin = 4 + int.from_bytes(answer[:4], "little")
    head = json.loads(answer[4:begin])
    kind, count = head["arrays"]["surface"]
    assert (kind, count, list(head["arrays"])[-1]) == ("<u4", 12, "surface")
    numbers = np.frombuffer(answer, "<u4", count, len(answer) - 4 * count)
    marks = preview_part(design).mesh.groups
    for name in ("Top", "bottom", "left", "right", "ends"):
        assert (np.array(head["groups"])[numbers[marks[name]]] == name).all()
