"""The flat charts of a report, as plotly figures: {"data": ..., "layout": ...}, from facts alone."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from chamberopt.output.plots.colours import BLUE, GREEN, GREY, ORANGE

Chart = dict[str, Any]
CLASSES = np.linspace(0.0, 1.0, 41)  # of a coverage histogram: 2.5 % each
SENT = {"start": ORANGE, "best": GREEN, "result": BLUE}
DASHED = {"start": "dot", "best": "solid", "result": "solid"}
ACROSS = 3  # slices side by side


def convergence(evaluations: Sequence[Mapping[str, Any]], label: str, smaller: bool) -> Chart:
    """Every evaluation in order, what misses a constraint or failed marked as such, the best so far, confirmations."""
    search = [one for one in evaluations if one["stage"] == "search"]
    good = [one for one in search if one["value"] is not None and one["feasible"]]
    better = np.minimum.accumulate if smaller else np.maximum.accumulate
    traces = [_points(good, "evaluation, 95 % interval", BLUE, "circle")]
    if good:
        best = better([one["value"] for one in good])
        steps = [one["number"] for one in good]
        end = max(one["number"] for one in search)
        traces.append(_line([*steps, end], [*best, best[-1]], "best so far", BLUE, shape="hv"))
    missed = [one for one in search if one["value"] is not None and not one["feasible"]]
    if missed:
        traces.append(_points(missed, "misses a constraint", GREY, "x-thin-open"))
    failed = [one for one in search if one["value"] is None]
    if failed:
        known = [one["value"] for one in evaluations if one["value"] is not None] or [0.0]
        foot = max(known) if smaller else min(known)
        down = [{**one, "value": foot, "half_width": None} for one in failed]
        traces.append(_points(down, "could not be simulated", "black", "triangle-down"))
    confirmed = [
        one for one in evaluations if one["stage"] == "confirm" and one["value"] is not None
    ]
    traces.append(_points(confirmed, "confirmed on fresh seeds", GREEN, "square"))
    chart = _figure(traces, 380, "evaluation", label)
    chart["layout"]["xaxis"] |= {"range": [0.5, len(evaluations) + 0.5], "tickformat": "d"}
    if confirmed:
        chart["layout"]["shapes"] = [_rule("x", len(search) + 0.5)]
    return chart


def slices(parameters: Sequence[Mapping[str, Any]], label: str) -> Chart:
    """The objective over each parameter by the study's model: others as in the best with the interval, main effect."""
    from plotly.subplots import make_subplots

    across = min(len(parameters), ACROSS)
    down = -(-len(parameters) // across)
    grid = make_subplots(
        rows=down,
        cols=across,
        shared_yaxes=True,
        horizontal_spacing=0.04,
        vertical_spacing=0.35 / down,
    )
    for n, one in enumerate(parameters):
        row, column = n // across + 1, n % across + 1
        mean, doubt = np.array(one["mean"]), np.array(one["half_width"])
        band: Chart = {"line": {"width": 0}, "hoverinfo": "skip", "showlegend": False}
        traces = [
            _scatter(one["values"], mean - doubt, "", BLUE, **band),
            _scatter(
                one["values"],
                mean + doubt,
                "",
                BLUE,
                **band,
                fill="tonexty",
                fillcolor=_faint(BLUE),
            ),
            _line(one["values"], mean, "the others as in the best, 95 % interval", BLUE),
            _line(one["values"], one["effect"], "mean over the others", "#5f6871", dash="dash"),
        ]
        for name in ("start", "best"):
            on = np.interp(one[name], one["values"], mean)
            mark = {
                "color": SENT[name],
                "size": 10,
                "symbol": {"start": "diamond", "best": "square"}[name],
            }
            traces.append(
                _scatter([one[name]], [on], name, SENT[name], mode="markers", marker=mark)
            )
        for trace in traces:
            grid.add_trace({"showlegend": n == 0, **trace}, row=row, col=column)
        grid.add_vrect(
            *one["flat"], fillcolor=GREEN, opacity=0.15, line_width=0, row=row, col=column
        )
        grid.update_xaxes(
            title_text=one["name"].rpartition(".")[2],
            title_font_size=12,
            range=one["bounds"],
            row=row,
            col=column,
        )
        if column == 1:
            grid.update_yaxes(title_text=label, row=row, col=column)
    return _figure([], 120 + 270 * down, "", "", grid)


def against_time(curves: Mapping[str, Sequence[Mapping[str, Any]]], treatment: float) -> Chart:
    """Mean coverage and that of the poorest twentieth against peening time, with their intervals."""
    traces = []
    for name, rows in curves.items():
        time, said = (
            [0.0, *(row["time_s"] for row in rows)],
            "" if name == "result" else f"{name}: ",
        )
        for column, doubt, what, dash in (
            ("mean_coverage", "half_width", "mean", "solid"),
            ("p05_coverage", "p05_half_width", "95 % of the area has more", "dash"),
        ):
            if not rows or column not in rows[0]:
                continue
            middle, reach = (
                100.0 * np.array([0.0, *(row[key] for row in rows)]) for key in (column, doubt)
            )
            low, high = np.clip(middle - reach, 0.0, 100.0), np.clip(middle + reach, 0.0, 100.0)
            band: Chart = {"line": {"width": 0}, "hoverinfo": "skip", "showlegend": False}
            traces.append(_scatter(time, low, "", SENT[name], **band))
            traces.append(
                _scatter(
                    time, high, "", SENT[name], **band, fill="tonexty", fillcolor=_faint(SENT[name])
                )
            )
            traces.append(_line(time, middle, said + what, SENT[name], dash=dash))
    chart = _figure(traces, 360, "peening time [s]", "coverage [%]")
    chart["layout"]["shapes"] = [_rule("y", 98.0), _rule("x", treatment)]
    chart["layout"]["annotations"] = [
        {
            "text": "98 % counts as full",
            "x": 0.01,
            "xref": "paper",
            "xanchor": "left",
            "y": 98.0,
            "yanchor": "bottom",
        },
        {"text": "treatment", "x": treatment, "xanchor": "left", "y": 0.0, "yanchor": "bottom"},
    ]
    for note in chart["layout"]["annotations"]:
        note |= {"showarrow": False, "font": {"size": 11, "color": "#3f474e"}}
    chart["layout"]["xaxis"]["rangemode"] = "tozero"
    chart["layout"]["yaxis"]["range"] = [0, 108]
    return chart


def histogram(shown: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> Chart:
    """Share of the target's area by its coverage: of each candidate, (coverage (k,) 0..1, area (k,))."""
    traces = []
    for name, (coverage, area) in shown.items():
        share, _ = np.histogram(coverage, CLASSES, weights=area)
        bars = 100.0 * share / max(area.sum(), 1e-300)
        edges, steps = (
            100.0 * np.repeat(CLASSES, 2),
            np.concatenate([[0.0], np.repeat(bars, 2), [0.0]]),
        )
        fill = {"fill": "tozeroy", "fillcolor": _faint(SENT[name])}
        traces.append(
            _line(
                edges,
                steps,
                "" if name == "result" else name,
                SENT[name],
                dash=DASHED[name],
                **fill,
            )
        )
    chart = _figure(traces, 360, "coverage [%]", "share of the target's area [%]")
    chart["layout"]["xaxis"]["range"] = [0, 100]
    chart["layout"]["showlegend"] = len(shown) > 1
    return chart


def _points(rows: Sequence[Mapping[str, Any]], name: str, colour: str, symbol: str) -> Chart:
    told = [
        "<br>".join(f"{key} = {value:.4g}" for key, value in row["parameters"].items())
        for row in rows
    ]
    return _scatter(
        [row["number"] for row in rows],
        [row["value"] for row in rows],
        name,
        colour,
        mode="markers",
        marker={
            "color": colour,
            "symbol": symbol,
            "size": 8,
            "line": {"width": 2 if symbol.endswith("open") else 0},
        },
        error_y={
            "array": [row["half_width"] or 0.0 for row in rows],
            "thickness": 1.2,
            "width": 3,
            "color": colour,
        },
        hovertext=told,
        hovertemplate="%{y:.4g}<br>%{hovertext}<extra></extra>",
    )


def _line(
    x: Any, y: Any, name: str, colour: str, dash: str = "solid", shape: str = "linear", **more: Any
) -> Chart:
    return _scatter(
        x, y, name, colour, line={"color": colour, "dash": dash, "shape": shape, "width": 2}, **more
    )


def _scatter(x: Any, y: Any, name: str, colour: str, mode: str = "lines", **more: Any) -> Chart:
    return {
        "type": "scatter",
        "x": [float(one) for one in x],
        "y": [float(one) for one in y],
        "name": name,
        "mode": mode,
        "hovertemplate": "%{x:.4g}: %{y:.4g}<extra>%{fullData.name}</extra>",
        **more,
    }


def _rule(axis: str, at: float) -> Chart:
    """A thin line across the chart at one value."""
    other = {"x": "y", "y": "x"}[axis]
    return {
        "type": "line", f"{axis}0": at, f"{axis}1": at, f"{other}0": 0, f"{other}1": 1, f"{other}ref": "paper",
        "line": {"color": "#5f6871", "width": 1, "dash": "dot"},
    }  # fmt: skip


def _figure(
    traces: Sequence[Chart], height: int, across: str, up: str, figure: Any = None
) -> Chart:
    import plotly.graph_objects as go

    figure = figure or go.Figure(list(traces))
    axis = {
        "gridcolor": "#e3e7ea",
        "zeroline": False,
        "linecolor": "#9aa3ab",
        "showline": True,
        "ticks": "outside",
    }
    figure.update_xaxes(**axis).update_yaxes(**axis)
    if traces:
        figure.update_xaxes(title_text=across).update_yaxes(title_text=up)
    figure.update_layout(
        template=None,
        height=height,
        margin={"l": 70, "r": 15, "t": 50, "b": 55},
        paper_bgcolor="white",
        plot_bgcolor="white",
        font={"family": "system-ui, sans-serif", "size": 13, "color": "#1c2226"},
        legend={
            "orientation": "h",
            "y": 1.0,
            "yanchor": "bottom",
            "x": 0.0,
            "traceorder": "normal",
        },
        hovermode="closest",
    )
    drawn: Chart = json.loads(figure.to_json())
    return drawn


def _faint(colour: str) -> str:
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},0.15)"
