"""The text of the page, section by section."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

from chamberopt.common.estimate import Estimate
from chamberopt.common.number_text import estimate_text, typeset
from chamberopt.documents.tolerances import tolerance_section
from chamberopt.documents.wording import interval_text, per_cent, plain, with_unit
from chamberopt.documents.zones import zones_section
from chamberopt.pictures.charts import result_charts
from chamberopt.pictures.part3d import PartScene
from chamberopt.printers import html

Contents = Mapping[str, Any]  # of report_contents, or a part of it
LIMITS_OF_INTERVALS = (
    "The intervals cover random variation between simulations only. They do not include errors in "
    "your restitution, friction and material data: calibrate those with your machine."
)
LIMITS_OF_CALIBRATED = (
    "The intervals cover random variation between simulations, and what the calibration of the "
    "machine leaves open. They do not include what the model itself leaves out."
)
TILES = ("mean_coverage", "p05_coverage", "time_to_98_s")  # shown beside the objective


def sections(
    contents: Contents, viewer: str, scenes: Mapping[str, PartScene], design_file: tuple[str, str]
) -> str:
    """HTML of the page below its title.

    Args:
        viewer: HTML of the part in 3D.
        scenes: by name of the result, for the coverage over the area.
        design_file: name and text.
    """
    is_study = contents["kind"] == "study"
    parts = [
        _question(contents),
        _answer(contents),
        html.section("The best chamber" if is_study else "The chamber", viewer),
    ]
    if is_study:
        parts += [_pareto_front(contents), _convergence(contents), _influence(contents)]
    parts += [
        _coverage(contents, scenes),
        zones_section(contents),
        tolerance_section(contents["tolerances"]),
        _accuracy_and_cost(contents),
        _effects(contents),
        _notes(contents),
        _design(contents, *design_file),
        html.section("Made with", html.table("", (), contents["identity"].items(), numbers=False)),
    ]
    return "".join(parts)


def _question(contents: Contents) -> str:
    question = contents["question"]
    part, reach = question["part"], ""
    if area := question["target"]["target_exposed_area_mm2"]:
        field = contents["field"]
        reach = (
            f" ({plain(area)} mm² in the chamber; the shot can reach "
            f"{per_cent(field['reachable_share'])} of it)"
        )
    peening = (
        f"for {plain(question['treatment_time_s'])} s in a chamber of shape “{question['shape']}”"
    )
    if contents["kind"] != "study":
        text = f"How is the target of {part}{reach} covered when it is peened {peening}?"
        return html.section("The question", html.paragraph(text))
    objective = question["objective"]
    meaning = f" ({objective['meaning']})" if objective["meaning"] else ""
    aim = "smallest" if question["smaller_is_better"] else "largest"
    text = (
        f"Which chamber gives the {aim} {objective['label']}{meaning}? "
        f"The part is {part}; its target{reach} is peened {peening}. "
        f"{question['evaluations']} candidates were tried, chosen by: {question['algorithm']}."
    )
    limits = "There were no constraints."
    if question["constraints"]:
        limits = f"Constraints: {', '.join(question['constraints'])}."
    rows = [
        (row["name"], row["values"], plain(row["start"]), plain(row["best"]))
        for row in question["vary"]
    ]
    varied = html.table("What was varied", ("parameter", "bounds", "start", "best"), rows)
    texts = html.paragraph(text) + html.paragraph(limits)
    return html.section("The question", html.pair(texts, varied))


def _answer(contents: Contents) -> str:
    tiles = []
    for i, row in enumerate(contents["metrics"]):
        if i and row["name"] not in TILES:
            continue
        start = ""
        if "start" in row:
            start = f'<dd class="start">start: {html.text(_tile_value(row, "start"))}</dd>'
        value = html.text(_tile_value(row, "result"))
        tiles.append(f"<div><dt>{html.text(row['label'])}</dt><dd>{value}</dd>{start}</div>")
    lines = "".join(
        html.paragraph(one.text, "warning" if one.warns else "") for one in contents["answer_lines"]
    )
    limits = LIMITS_OF_CALIBRATED if contents["calibrated"] else LIMITS_OF_INTERVALS
    content = (
        f"{html.paragraph(contents['answer'], 'sentence')}{lines}"
        f'<dl class="tiles">{"".join(tiles)}</dl>{html.paragraph(limits, "soft")}'
    )
    return f'<section class="answer"><h2>The answer</h2>{content}</section>'


def _tile_value(row: Contents, which: str) -> str:
    return interval_text(row[which], row["unit"])


def _interval(row: Contents, which: str, sign: bool = False) -> str:
    return interval_text(row[which], sign=sign)


def _label(row: Contents) -> str:
    return f"{row['label']} [{row['unit']}]" if row["unit"] else str(row["label"])


def _pareto_front(contents: Contents) -> str:
    front = contents["front"]
    if not front:
        return ""
    first, second = (_label(objective) for objective in front[0]["objectives"])
    text = (
        f"The study had two objectives: {first}, and {second}. Each of these candidates was "
        "confirmed on fresh seeds, and no other is better in both objectives. "
        "The answer above is the best by the first objective."
    )
    rows = (
        (
            number,
            *(_interval(objective, "result") for objective in row["objectives"]),
            *map(plain, row["parameters"].values()),
        )
        for number, row in enumerate(front, start=1)
    )
    head = ("", first, second, *front[0]["parameters"])
    table = html.table("The Pareto front", head, rows)
    return html.section("Two objectives", html.paragraph(text), table)


def _convergence(contents: Contents) -> str:
    rows, question = contents["evaluations"], contents["question"]
    if not rows:
        return ""
    svg = result_charts.convergence_chart(
        rows, _label(question["objective"]), question["smaller_is_better"]
    )
    caption = (
        "The objective of every evaluation in its order. The answer rests on the last ones, which "
        "ran on fresh seeds. Point at a mark to see its parameters."
    )
    failed = [(row["number"], row["reason"]) for row in rows if row["reason"]]
    folded = ""
    if failed:
        reasons = html.table("", ("evaluation", "reason"), failed, numbers=False)
        folded = html.fold(
            f"Evaluations not simulated, or that missed a constraint: {len(failed)}", reasons
        )
    return html.section("How the search went", html.chart("convergence", svg, caption), folded)


def _influence(contents: Contents) -> str:
    influence, objective = contents["influence"], contents["question"]["objective"]
    if not influence:
        return ""
    parameters = influence["parameters"]
    content = [html.items(influence["said"])]
    if parameters:
        head = (
            "parameter",
            "moved alone costs",
            "where surest, at least",
            "own share of variance",
            "no loss within",
        )
        rows = [
            (
                row["name"],
                row["loss_text"],
                with_unit(row["surely"], objective["unit"]) if row["surely"] else "not known",
                per_cent(row["share"]),
                (" or " if row["texts"] else " to ").join(map(plain, row["flat"])),
            )
            for row in parameters
        ]
        caption = (
            "Each parameter alone. Band: 95 % interval of the model; without one: as bad or worse. "
            "Shaded range: no more than the noise is lost. Above: how much of the variance over "
            "the bounds is that of the dashed line; what is missing to 100 % is how parameters act "
            "together."
        )
        svg = result_charts.slices_chart(parameters, _label(objective))
        content.append(html.table("By a model of all evaluations", head, rows))
        content.append(html.chart("slices", svg, caption))
    return html.section("Which parameters mattered", *content)


def _coverage(contents: Contents, scenes: Mapping[str, PartScene]) -> str:
    has_start = "start" in contents["coverage_against_time"]
    head: tuple[str, ...] = ("", "with 95 % interval")
    rows: list[tuple[str, ...]] = [
        (_label(row), _interval(row, "result")) for row in contents["metrics"]
    ]
    if has_start:
        head = ("", "start", "best", "change", "more than noise")
        rows = [
            (
                _label(row),
                _interval(row, "start"),
                _interval(row, "result"),
                _interval(row, "change", sign=True),
                "exact" if row["exact"] else "yes" if row["real"] else "no",
            )
            for row in contents["metrics"]
            if "start" in row
        ]
    caption = (
        "How much of the target's area has which coverage at the end of the treatment, "
        "as the picture above shows it. Both are of single windows, where counted dents scatter: "
        "they look less even than the target is. The figures in the table are corrected for that."
    )
    shown = {
        name: (scene.coverage, scene.area)
        for name, scene in scenes.items()
        if scene.coverage is not None
    }
    pair = [html.chart("histogram", result_charts.histogram_chart(shown), caption)] if shown else []
    few = [name for name in scenes if name not in shown]
    if curves := {name: rows for name, rows in contents["coverage_against_time"].items() if rows}:
        treatment_time = contents["question"]["treatment_time_s"]
        svg = result_charts.coverage_over_time_chart(curves, treatment_time)
        caption = (
            "Coverage against peening time; 98 % counts as full. Bands are 95 % intervals, and "
            "often narrower than their line. The thin line is zero where more than 5 % of the "
            "target is out of reach."
        )
        pair.append(html.chart("against-time", svg, caption))
    table = html.table("± 95 % intervals", head, rows)
    title = "Compared with the start" if has_start else "Coverage"
    which = f" of the {' and the '.join(few)}" if has_start else ""
    text = (
        f"How much of the area has which coverage is not drawn{which}: too few dents were "
        "simulated to tell single places apart."
    )
    remark = html.paragraph(text, "soft") if few else ""
    return html.section(title, table, _windows(contents), html.pair(*pair), remark)


def _windows(contents: Contents) -> str:
    """The windows in which coverage is measured, and its figures in windows of twice the radius."""
    field = contents["field"]
    text = (
        f"Coverage is the share dented in a window of {plain(field['gauge_mm2'])} mm² round each "
        f"point of the target. The median window has {plain(field['dents'], 2)} simulated dents. "
        f"{per_cent(field['crease_share'])} of the dented area is on sharp edges."
    )
    wide = [(_label(row), _interval(row, "result")) for row in field["double_gauge"]]
    caption = f"In windows of {plain(4.0 * field['gauge_mm2'])} mm², twice as wide"
    return html.paragraph(text) + html.fold(caption, html.table("", ("", "± 95 %"), wide))


def _accuracy_and_cost(contents: Contents) -> str:
    titles = {"answer": "What the answer cost", "evaluations": "Evaluations of the study"}
    accuracy = html.table("How accurate it is", (), contents["accuracy"].items(), numbers=False)
    cost = "".join(
        html.table(titles[name], (), rows.items(), numbers=False)
        for name, rows in contents["cost"].items()
    )
    return html.section("Accuracy and cost", html.pair(accuracy, cost))


def _effects(contents: Contents) -> str:
    effects, pilot = contents["effects"]["effects"], contents["effects"]["pilot"]
    switched = [(one["effect"], one["value"]) for one in effects]
    content = [html.table("In this result", (), switched, numbers=False)]
    if pilot:
        rows = [
            (one.effect, one.verdict, *(_percentage(change) for change in one.changes.values()))
            for one in pilot
        ]
        head = ("effect", "verdict", *(f"change of {name}" for name in pilot[0].changes))
        content += [
            html.paragraph(
                "The effects were chosen by a short pilot run, in which each was switched alone:"
            ),
            html.table("", head, rows),
            html.items(one.said for one in pilot),
        ]
    else:
        content.append(
            html.paragraph(
                "No pilot run was made to estimate what each effect changes. "
                "“chamberopt check --pilot” makes one for a design."
            )
        )
    return html.section("Physical effects", *content)


def _percentage(change: Estimate) -> str:
    return typeset(estimate_text(change, 100.0, "%", sign=True))


def _notes(contents: Contents) -> str:
    warnings = contents["warnings"]
    notes = [*(f"Warning: {text}" for text in warnings or ()), *contents["notes"]]
    content = [html.paragraph(note, "warning") for note in notes]
    if warnings is None:
        content.append(
            html.paragraph("The design was not checked; “chamberopt check” lists its warnings.")
        )
    elif not notes:
        content.append(html.paragraph("There are no notes or warnings."))
    return html.section("Notes and warnings", *content)


def _design(contents: Contents, name: str, text: str) -> str:
    rows = contents["design"]
    changed = [(row["name"], row["start"], row["value"]) for row in rows if "start" in row]
    differences = ""
    if changed:
        differences = html.table("What differs from the start", ("", "start", "best"), changed)
    values = [(row["name"], row["value"]) for row in rows]
    every = html.table("", ("", "value"), values, numbers=False)
    link = f"data:text/plain;charset=utf-8;base64,{base64.b64encode(text.encode()).decode()}"
    save = f'<p><a download="{html.text(name)}" href="{link}">Save {html.text(name)}</a></p>'
    return html.section(
        "The design",
        differences,
        html.fold("Every value of the design", every, "print"),
        html.fold(f"{name}, for chamberopt simulate", f"{save}<pre>{html.text(text)}</pre>"),
    )
