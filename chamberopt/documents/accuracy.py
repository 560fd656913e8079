"""Text about an accuracy study: how the error of coverage etc. falls with the simulation's cost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chamberopt.common.number_text import plain
from chamberopt.documents.document import Table
from chamberopt.simulation.numerical_parameters import FACETS, TIME, setting_text, short_name
from chamberopt.simulation.recommendation import ACCURACIES, recommend

if TYPE_CHECKING:
    from chamberopt.common.estimate import Estimate
    from chamberopt.simulation.convergence import ConvergenceStudy
    from chamberopt.simulation.recommendation import Recommendation


def accuracy_end(study: ConvergenceStudy, verbose: bool) -> list[Table | str]:
    """Return the end of the command `accuracy`: a sentence, what each accuracy costs, and settings.

    Args:
        verbose: what was measured of each numerical parameter follows.
    """
    found = [recommend(study, accuracy) for accuracy in ACCURACIES]
    head = ("half-width", "replicas", "each of", "CPU s")
    table = Table("", head, [_cost(one) for one in found])
    blocks = [line for one in found for line in ("", *one.lines)]
    more = ["", *accuracy_lines(study)] if verbose else []
    total = f"{study.cpu_s:.0f} CPU s without compiling, {study.wall_s:.0f} s in all"
    if study.left_out:
        total += f"; left out by --budget-s: {', '.join(map(short_name, study.left_out))}"
    return [_sentence(study, found[1]), "", table, *blocks, *more, "", total]


def _sentence(study: ConvergenceStudy, one: Recommendation) -> str:
    """Return in one sentence what an accuracy of the objective costs, and half of the error."""
    text = f"± {one.accuracy:g} of the uniform coverage"
    if not one.replicas:
        return f"{text} is not reachable with these settings: {one.remarks[-1]}."  # what limits it
    _, count, simulated, seconds = _cost(one)
    text += f" takes about {seconds} CPU s: {count} replicas of {simulated}"
    law = study.law
    if law is not None and law.halving is not None:
        middle, low, high = (plain(value, 2) for value in law.halving)
        text += f"; half the error costs {middle} times as much ({low} to {high})"
    return f"{text}."


def _cost(one: Recommendation) -> tuple[str, str, str, str]:
    """Return the accuracy, replicas, simulated time of each, and CPU seconds as a table's row."""
    accuracy = f"± {one.accuracy:g}"
    if not one.replicas:
        return accuracy, "-", "-", "not reachable"
    seconds = plain(one.cpu_s, 2 if one.cpu_s < 100.0 else 3)
    return accuracy, f"{one.replicas}", f"{setting_text(one.settings[TIME])} s", seconds


def accuracy_lines(study: ConvergenceStudy) -> list[str]:
    """Return lines on the reference, on more replicas, and on each numerical parameter."""
    lines = [
        describe_reference(study),
        "",
        f"{'replicas':>10}{'CPU s':>9}{'RMS error':>12}{'95 % interval':>20}{'own interval':>15}",
    ]
    for size in study.sizes:
        low, high = size.interval
        lines.append(
            f"{size.replicas:10}{size.cpu_s:9.2f}{size.rms:12.4f}{low:11.4f} .. {high:.4f}"
            f"{f'± {size.half_width:.4f}':>15}"
        )
    lines += [
        describe_error_law(study),
        "",
        f"{'parameter':24}{'setting':>24}{'CPU s a replica':>19}"
        f"{'bias of objective':>21}{'of mean coverage':>21}",
    ]
    for run in study.runs:
        cpu = f"{run.cpu.value:.3f} ± {run.cpu.half_width:.3f}"
        biases = "".join(f"{_signed(bias):>21}" for bias in (run.bias, run.mean_bias))
        lines.append(f"{short_name(run.parameter):24}{run.setting:>24}{cpu:>19}{biases}")
    return lines


def _signed(bias: Estimate) -> str:
    exact = bias.value == bias.half_width == 0.0
    return "0" if exact else f"{bias.value:+.4f} ± {bias.half_width:.4f}"


def describe_reference(study: ConvergenceStudy) -> str:
    """Return a sentence with the settings and estimates of the reference simulation.

    All other simulations of the study are compared with the reference.
    """
    run = study.reference
    settings = ", ".join(
        f"{short_name(name)} {setting_text(value)}" for name, value in study.settings.items()
    )
    walls = f"; no chamber here has a round wall, so {FACETS} can only be compared with the finest"
    tried = FACETS in study.settings and FACETS not in study.left_out
    remark = walls if tried else ""
    return (
        f"reference: {run.replicas} replicas with {settings}: objective {run.objective.value:.4f} "
        f"± {run.objective.half_width:.2g}, mean coverage {run.mean.value:.4f} ± "
        f"{run.mean.half_width:.2g}, in {run.replicas * run.cpu.value:.0f} CPU s{remark}"
    )


def describe_error_law(study: ConvergenceStudy) -> str:
    """Return a sentence with the factor in cost that halves the error.

    The factor is 4 if the error comes from independent replicas alone. If it is another factor, the
    sentence gives the reason. If the factor is hardly known, the sentence says so.
    """
    law, sizes = study.law, study.sizes
    if law is None or law.halving is None:
        return (
            f"more replicas alone: {sum(one.batches for one in sizes)} batches do not tell what "
            "halving the error costs; it is 4 times as much for independent replicas; raise "
            "--budget-s"
        )
    middle, low, high = law.halving
    unresolved = [str(size.replicas) for size in sizes if not size.is_resolved]
    left_out = len(unresolved) <= len(sizes) - 2
    reason = "as independent replicas should: 4"
    if high < 4.0:
        reason = "less than the 4 of independent replicas"
        if not left_out:
            reason += ", because the windows have too few dents, and more replicas end it"
    elif low > 4.0:
        reason = (
            "more than the 4 of independent replicas: some replicas differ much from the others"
        )
    cost = f"costs {middle:.2f} times as much ({low:.2f} to {high:.2f}), {reason}"
    text = (
        f"more replicas alone: halving the error {cost} "
        f"(error ~ cost^-{law.power:.2f} ± {law.half_width:.2f})"
    )
    if unresolved and left_out:
        text += (
            f"; {', '.join(unresolved)} replicas are left out, because their windows have too few "
            "dents"
        )
    return text
