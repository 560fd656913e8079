"""Which parameters mattered, from the model that a study made of all its evaluations."""

from __future__ import annotations

import math
from typing import Any

from chamberopt.optimize.candidates import POINTS_PER_PARAMETER
from chamberopt.output.report.formatting import share, with_interval, with_unit
from chamberopt.output.report.words import Words


def influence(study: dict[str, Any], goal: Words) -> dict[str, Any]:
    """From result.json's "study": "said", sentences, and "parameters", the most important first, empty without a model.

    Of each parameter: loss, what moving it alone from the best to the worst place within its bounds costs by the model,
    with an interval; surely: the most that such a move, to wherever the model knows it best, costs for sure, 0 where it
    is told from nothing nowhere; share of the variance over the bounds that its main effect is; flat, where it may lie
    without losing more than the noise; the curves, in the unit shown.
    """
    model, count, names = study.get("model"), study["evaluations"], list(study["vary"])
    if not model:
        return {"parameters": [], "said": [_why_none(count, study.get("failed", 0), len(names))]}
    found = sorted(
        (_parameter(name, model, study, goal) for name in names),
        key=lambda one: (-one["surely"], -one["loss"]),
    )
    told = [one for one in found if one["surely"]]
    said = []
    if told:
        most = told[0]
        said.append(
            f"{most['name']} mattered most: moved alone from its best value to another within its bounds, it costs up "
            f"to {with_interval(most['loss'], most['loss_half_width'], goal.unit)}, and for sure "
            f"{with_unit(most['surely'], goal.unit)} or more."
        )
    unknown = [one["name"] for one in found if not one["surely"]]
    if unknown:
        few = (
            f"{count} evaluations are too few to tell the influence of {_listed(unknown)} from none"
        )
        said.append(f"{few}: the intervals reach zero.")
    shares = sum(one["share"] for one in found)
    if len(found) > 1:
        rest = (
            "; the rest is how they act together, so each curve below holds near the best design"
            * (shares < 0.8)
        )
        on_its_own = "Main effects, each parameter on its own, are"
        said.append(f"{on_its_own} {share(shares)} of the variance over the bounds{rest}.")
    together = (
        f"of all designs with every parameter within these, {share(model['together'])} lose no more"
    )
    noise = with_unit(abs(goal.factor) * model["noise"], goal.unit)
    said.append(f"The shaded ranges lose no more than the noise, {noise}, each alone; {together}.")
    return {"parameters": found, "said": said}


def _parameter(
    name: str, model: dict[str, Any], study: dict[str, Any], goal: Words
) -> dict[str, Any]:
    one, top = model["parameters"][name], model["expected"]
    size = abs(goal.factor)
    losses = [size * (top["value"] - mean) for mean in one["mean"]]
    doubts = [size * math.hypot(half_width, top["half_width"]) for half_width in one["half_width"]]
    worst = max(range(len(losses)), key=losses.__getitem__)
    return {
        "name": name,
        "share": one["share_of_variance"],
        "loss": max(0.0, losses[worst]),
        "loss_half_width": doubts[worst],
        "surely": max(0.0, *(loss - doubt for loss, doubt in zip(losses, doubts, strict=True))),
        "flat": one["flat"],
        "bounds": study["vary"][name],
        "start": study["start"]["parameters"][name],
        "best": study["best"]["parameters"][name],
        "values": one["values"],
        "mean": [goal.factor * value for value in one["mean"]],
        "half_width": [size * value for value in one["half_width"]],
        "effect": [goal.factor * value for value in one["main_effect"]],
    }


def _why_none(count: int, failed: int, parameters: int) -> str:
    enough = POINTS_PER_PARAMETER * parameters
    if count - failed < enough:
        told = (
            f"{count} evaluations, {failed} of them failed," if failed else f"{count} evaluations"
        )
        return f"{told} are too few to tell what each parameter does: {enough} or more are needed for a model of them."
    return "There is no model of the evaluations in this result, so it cannot tell what each parameter does."


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
