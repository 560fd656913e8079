"""The page's text, section by section, in the order a reader asks."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

from chamberopt.output.report import charts, html
from chamberopt.output.report.formatting import plain, share, with_interval, with_unit
from chamberopt.output.report.part3d import Scene

Facts = Mapping[str, Any]
SURE = (
    "The intervals count chance: how far the figures would move if the same design were simulated anew. How well its "
    "restitution, friction and materials fit your machine they cannot know: calibrate those."
)
TILES = ("mean_coverage", "p05_coverage", "time_to_98_s")  # beside the objective


def sections(said: Facts, viewer: str, shown: Mapping[str, Scene], design: tuple[str, str]) -> str:
    """All of the page below its title. viewer: HTML of the part in 3D · shown: coverage of each candidate, by name ·
    design: name and text of the design file.
    """
    study = said["kind"] == "study"
    parts = [
        _question(said),
        _answer(said),
        html.section("The best chamber" if study else "The chamber", viewer),
    ]
    if study:
        parts += [_front(said), _convergence(said), _influence(said)]
    parts += [
        _coverage(said, shown),
        _accuracy(said),
        _effects(said),
        _notes(said),
        _design(said, *design),
    ]
    return "".join(
        [
            *parts,
            html.section("Made with", html.table("", (), said["identity"].items(), figures=False)),
        ]
    )


def _question(said: Facts) -> str:
    asked = said["question"]
    target = asked["target"]
    area = target.get("target_exposed_area_mm2")
    reach = (
        f", of which the shot can reach {plain(area)} mm² in {target['target_triangles']} triangles"
        if area
        else ""
    )
    peened = f"for {plain(asked['treatment_time_s'])} s in a chamber of shape “{asked['shape']}”"
    goal, meaning = (asked["objective"][key] for key in ("label", "meaning"))
    goal += f" ({meaning})" if meaning else ""
    if said["kind"] != "study":
        text = f"How is the target of {asked['part']}{reach} covered when it is peened {peened}?"
        return html.section("The question", html.paragraph(text))
    aim = "smallest" if asked["smaller_is_better"] else "largest"
    text = (
        f"Which chamber gives the {aim} {goal}? The part is {asked['part']}, with its target{reach}, peened {peened}. "
        f"{asked['evaluations']} candidates were simulated; they were chosen by: {asked['algorithm']}."
    )
    limits = (
        f"Constraints: {'; '.join(asked['constraints'])}."
        if asked["constraints"]
        else "There were no constraints."
    )
    rows = [
        (
            one["name"],
            f"{plain(one['low'])} to {plain(one['high'])}",
            plain(one["start"]),
            plain(one["best"]),
        )
        for one in asked["vary"]
    ]
    varied = html.table("What was varied", ("parameter", "bounds", "start", "best"), rows)
    return html.section(
        "The question", html.pair(html.paragraph(text) + html.paragraph(limits), varied)
    )


def _answer(said: Facts) -> str:
    told = html.paragraph(said["answer"], "said")
    tiles = []
    for i, row in enumerate(said["metrics"]):
        if i and row["name"] not in TILES:
            continue
        was = (
            f'<dd class="was">start: {html.text(_figure(row, "start"))}</dd>'
            if "start" in row
            else ""
        )
        tiles.append(
            f"<div><dt>{html.text(row['label'])}</dt><dd>{html.text(_figure(row, 'result'))}</dd>{was}</div>"
        )
    inside = f'{told}<dl class="tiles">{"".join(tiles)}</dl>{html.paragraph(SURE, "soft")}'
    return f'<section class="answer"><h2>The answer</h2>{inside}</section>'


def _figure(row: Facts, which: str) -> str:
    if row["name"] == "time_to_98_s" and row[which]["half_width"] >= row[which]["value"]:
        return "not known yet"
    return with_interval(row[which]["value"], row[which]["half_width"], row["unit"])


def _bare(row: Facts, which: str, sign: bool = False) -> str:
    return with_interval(row[which]["value"], row[which]["half_width"], sign=sign)


def _label(row: Facts) -> str:
    return f"{row['label']} [{row['unit']}]" if row["unit"] else str(row["label"])


def _goal(said: Facts) -> str:
    return _label(said["question"]["objective"])


def _front(said: Facts) -> str:
    front = said["front"]
    if not front:
        return ""
    first, second = (_label(goal) for goal in front[0]["objectives"])
    text = (
        f"Two objectives were sought at once: {first}, and {second}. These candidates, confirmed on fresh seeds, are "
        "beaten in both by none; the answer above is the best by the first."
    )
    rows = (
        (
            n,
            *(_bare(goal, "result") for goal in one["objectives"]),
            *map(plain, one["parameters"].values()),
        )
        for n, one in enumerate(front, start=1)
    )
    table = html.table("The front", ("", first, second, *front[0]["parameters"]), rows)
    return html.section("Two objectives", html.paragraph(text), table)


def _convergence(said: Facts) -> str:
    rows = said["evaluations"]
    if not rows:
        return ""
    drawn = charts.convergence(rows, _goal(said), said["question"]["smaller_is_better"])
    text = "The objective of every evaluation in its order; the last, on fresh seeds, are what the answer rests on."
    poor = [row for row in rows if row["reason"]]
    reasons = html.table(
        "",
        ("evaluation", "reason"),
        ((row["number"], row["reason"]) for row in poor),
        figures=False,
    )
    folded = (
        html.fold(f"{len(poor)} evaluations failed or missed a constraint", reasons) if poor else ""
    )
    return html.section("How the search went", html.chart("convergence", drawn, text), folded)


def _influence(said: Facts) -> str:
    found = said["influence"]
    if not found:
        return ""
    rows, unit = found["parameters"], said["question"]["objective"]["unit"]
    content = [html.items(found["said"])]
    if rows:
        head = (
            "parameter",
            "moved alone costs up to",
            "and for sure",
            "share of variance",
            "no loss within",
        )
        content.append(
            html.table(
                "By the model of all evaluations", head, (_mattered(row, unit) for row in rows)
            )
        )
        text = "Each parameter alone. Band: 95 % interval of the model; shaded: where no more than the noise is lost."
        content.append(html.chart("slices", charts.slices(rows, _goal(said)), text))
    return html.section("Which parameters mattered", *content)


def _mattered(row: Facts, unit: str) -> tuple[str, ...]:
    loss = with_interval(row["loss"], row["loss_half_width"], unit)
    surely = with_unit(row["surely"], unit) if row["surely"] else "not told"
    return row["name"], loss, surely, share(row["share"]), " to ".join(map(plain, row["flat"]))


def _coverage(said: Facts, shown: Mapping[str, Scene]) -> str:
    study = "start" in said["coverage_against_time"]
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]
    if study:
        head = ("", "start", "best", "change", "more than noise")
        rows = [
            (
                _label(row),
                _bare(row, "start"),
                _bare(row, "result"),
                _bare(row, "change", sign=True),
                "yes" if row["real"] else "no",
            )
            for row in said["metrics"]
            if "start" in row
        ]
    else:
        head, rows = (
            ("", "with 95 % interval"),
            [(_label(row), _bare(row, "result")) for row in said["metrics"]],
        )
    curves = {name: rows for name, rows in said["coverage_against_time"].items() if rows}
    pair = [
        html.chart(
            "histogram",
            charts.histogram({n: (s.coverage, s.area) for n, s in shown.items()}),
            HISTOGRAM,
        )
    ]
    if curves:
        chart = charts.against_time(curves, said["question"]["treatment_time_s"])
        pair.append(
            html.chart("against-time", chart, "Coverage against peening time, with 95 % intervals.")
        )
    figures = html.table("± 95 % intervals", head, rows)
    title = "Compared with the start" if study else "Coverage"
    return html.section(title, figures, html.pair(*pair))


HISTOGRAM = "How much of the target's area has which coverage at the end of the treatment, as the picture above shows it."


def _accuracy(said: Facts) -> str:
    titles = {"answer": "What the answer cost", "evaluations": "Evaluations of the study"}
    known = html.table("How well it is known", (), said["accuracy"].items(), figures=False)
    paid = "".join(
        html.table(titles[name], (), rows.items(), figures=False)
        for name, rows in said["cost"].items()
    )
    return html.section("Accuracy, and its price", html.pair(known, paid))


def _effects(said: Facts) -> str:
    found = said["effects"]
    if found["pilot"]:
        text = "The effects were chosen by a short pilot run, in which each was switched alone:"
        rows = [
            (
                one["effect"],
                one["verdict"],
                *(_changed(change) for change in one["changes"].values()),
            )
            for one in found["pilot"]
        ]
        head = ("effect", "verdict", *(f"{name} with it" for name in found["pilot"][0]["changes"]))
        told = html.table("", head, rows) + html.items(one["said"] for one in found["pilot"])
    else:
        text = "No pilot run was made to estimate what each effect changes; chamberopt check, given the design, makes one."
        told = ""
    on = [(one["effect"], one["value"]) for one in found["effects"]]
    return html.section(
        "Physical effects",
        html.table("In this result", (), on, figures=False),
        html.paragraph(text),
        told,
    )


def _changed(change: Facts) -> str:
    return with_interval(100.0 * change["value"], 100.0 * change["half_width"], "%", sign=True)


def _notes(said: Facts) -> str:
    warned = said["warnings"]
    found = [*(f"Warning: {text}" for text in warned or ()), *said["notes"]]
    told = [html.paragraph(note, "warning") for note in found]
    if warned is None:
        told.append(
            html.paragraph(
                "Whether the design itself gives cause for warnings, “chamberopt check” tells."
            )
        )
    elif not found:
        told.append(html.paragraph("The run left no notes or warnings."))
    return html.section("Notes and warnings", "".join(told))


def _design(said: Facts, name: str, text: str) -> str:
    rows = said["design"]
    changed = [(row["name"], row["start"], row["value"]) for row in rows if "start" in row]
    differs = (
        html.table("What differs from the start", ("", "start", "best"), changed) if changed else ""
    )
    whole = html.table(
        "", ("", "value"), [(row["name"], row["value"]) for row in rows], figures=False
    )
    link = f"data:text/plain;charset=utf-8;base64,{base64.b64encode(text.encode()).decode()}"
    save = f'<p><a download="{html.text(name)}" href="{link}">Save {html.text(name)}</a></p>'
    file = html.fold(
        f"{name}, which chamberopt simulate takes", f"{save}<pre>{html.text(text)}</pre>"
    )
    return html.section(
        "The design", differs, html.fold("Every number of the design", whole, "print"), file
    )
