"""What searches and studies leave: a table of all runs (CSV), the answer (JSON), and words."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

from analytic.whole_file import write_whole
from warp_mpm.by_simulation.barrier import Answer, answer_scenario
from warp_mpm.by_simulation.fields import words
from warp_mpm.by_simulation.limits import DISPLACEMENTS
from warp_mpm.by_simulation.uncertain import SAMPLES, Study
from warp_mpm.quantities import Quantity
from warp_mpm.recording.run_folder import finite
from warp_mpm.scenario import Scenario, Trapezoid

TRIED, ANSWER, BARRIER, PICTURE = "tried.csv", "answer.json", "barrier.json", "answer.png"
"""Files in the folder of a search: all trials, the answer, the answer as a scenario, the chart."""

RUNS, STUDY, STUDY_PICTURE = "runs.csv", "uncertainty.json", "uncertainty.png"
"""Files in the folder of a study: all runs, what it found, the chart."""

ALSO = ("peak_force_filtered", "impulse", "barrier_displacement_final", "overtopped_volume", "run_up_max")
"""Figures of every trial beside those that are limited."""


def write_answer(folder: Path, answer: Answer) -> None:
    """Write the table, the answer and its scenario, each whole or not at all."""
    write_whole(folder / TRIED, _as_csv(rows(answer)))
    write_whole(folder / ANSWER, json.dumps(finite(content(answer)), indent=2, ensure_ascii=False) + "\n")
    if answer.best is not None:
        scenario = answer_scenario(answer)
        write_whole(folder / BARRIER, json.dumps(scenario.resolved(), indent=2, ensure_ascii=False) + "\n")


def rows(answer: Answer) -> list[dict[str, Any]]:
    """One row for each trial, the lightest first: its values, objective, figures (SI), whether it holds."""
    names = list(dict.fromkeys([*(limit.name for limit in answer.question.limits), *ALSO]))
    found = []
    for one, run in sorted(answer.tried, key=lambda pair: pair[0].objective):
        figures = run.figures or {}
        found.append(
            {
                **answer.question.values(one.point),
                answer.question.objective.name: one.objective,
                "keeps_limits": one.holds,
                **{name: figures.get(name) for name in names},
                "barrier_at_rest": figures.get("barrier_at_rest"),
                "spacing_m": run.scenario.numerics.spacing_m,
                "wall_time": run.wall_time,
                "problem": run.problem,
            }
        )
    return found


def _as_csv(table: list[dict[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(table[0]) if table else [])
    writer.writeheader()
    writer.writerows({name: "" if value is None else value for name, value in row.items()} for row in table)
    return text.getvalue()


def content(answer: Answer) -> dict[str, Any]:
    """All of an answer as plain data, SI."""
    question, best = answer.question, answer.best
    return {
        "scenario": question.scenario.title,
        "limits": [
            {"figure": limit.name, "bound": limit.bound, "unit": limit.quantity.unit, "least": limit.least}
            for limit in question.limits
        ],
        "vary": {one.path: [one.low, one.high] for one in question.ranges},
        "minimize": question.objective.name,
        "found": best is not None,
        "confirmed": answer.confirmed,
        "values": None if best is None else question.values(best.point),
        "objective": None if best is None else best.objective,
        "objective_uncertainty": answer.objective_uncertainty,
        "uncertainty_is": "of the grid's spacing alone, from three spacings of the answer",
        "spacings": [
            {
                "spacing_m": rung.spacing,
                "wall_time": rung.wall_time,
                **{limit.name: (rung.figures or {}).get(limit.name) for limit in question.limits},
            }
            for rung in answer.rungs
        ],
        "limited_figures": [
            {"figure": known.limit.name, "value": known.value, "uncertainty": known.uncertainty, "sure": known.sure}
            for known in answer.known
        ],
        "closed_form": answer.closed_form or None,
        "assumption": {
            "trials": len(answer.tried),
            "pairs_against": answer.contradictions,
            "lighter_sampled": len(answer.sampled),
            "lighter_that_hold": sum(one.holds for one in answer.sampled),
        },
        "remarks": answer.remarks,
        "tried": rows(answer),
    }


def shape(scenario: Scenario) -> str:
    """The barrier's measures in a few words."""
    barrier = scenario.barrier
    if barrier is None or not isinstance(barrier.shape, Trapezoid):
        return ""
    base, crest, height = barrier.shape.base_crest_height
    return f"B = {base:.3g} m, b = {crest:.3g} m, H = {height:.3g} m, β = {barrier.shape.built_face_angle_deg:.3g}°"


def told(answer: Answer) -> list[tuple[str, str]]:
    """The answer as rows of words and values."""
    question, best = answer.question, answer.best
    limits = "; ".join(limit.text for limit in question.limits)
    if best is None:
        ranges = "; ".join(f"{words(one.path)} {one.low:.4g} to {one.high:.4g}" for one in question.ranges)
        nearest = min(answer.tried, key=lambda pair: (pair[0].excess, -pair[0].objective))
        figures = nearest[1].figures or {}
        came = "; ".join(f"{limit.quantity.words} {limit.shown(figures.get(limit.name))}" for limit in question.limits)
        at = ", ".join(f"{words(path)} {value:.4g}" for path, value in question.values(nearest[0].point).items())
        return [("limits", limits), ("tried", ranges), ("no barrier keeps the limits; nearest", at), ("  with", came)]
    found = [("limits", limits)]
    objective = question.objective
    text = objective.text(best.objective)
    if answer.objective_uncertainty is not None:
        text += f" ± {objective.text(answer.objective_uncertainty)}, from the grid's spacing alone"
    found.append((f"least {objective.words}", text))
    found.append(("  barrier", shape(answer_scenario(answer))))
    found += [(f"  {words(path)}", f"{value:.4g}") for path, value in question.values(best.point).items()]
    for limit in question.limits:
        ladder = [
            f"{limit.shown((rung.figures or {}).get(limit.name))} at {rung.spacing:.3g} m" for rung in answer.rungs
        ]
        found.append((limit.quantity.words, "; ".join(ladder)))
        for known in answer.known:
            if known.limit is limit:
                found.append(("  leads to", f"{limit.shown(known.value)} ± {limit.shown(known.uncertainty)}"))
    if answer.confirmed is None:
        found.append(("confirmed", "not asked for"))
    else:
        finest = answer.rungs[-1].spacing
        found.append(("confirmed", f"{'yes' if answer.confirmed else 'NO'}, by a run at {finest:.3g} m"))
    if "displacement" in answer.closed_form:
        moved = answer.closed_form["displacement"]
        limit_text = f"the closed form says it slides {moved:.3g} m"
        if "objective" in answer.closed_form:
            ratio = answer.closed_form["objective"] / best.objective
            limit_text += (
                f", and has its own answer at {objective.text(answer.closed_form['objective'])}, × {ratio:.2f}"
            )
        found.append(("closed form", limit_text))
    elif any(limit.name in DISPLACEMENTS for limit in question.limits):
        found.append(("closed form", "has no answer to this scene"))
    lighter = sum(one.holds for one in answer.sampled)
    found.append(
        (
            "assumption",
            f"heavier is safer: {answer.contradictions} pairs of {len(answer.tried)} trials against it; of "
            f"{len(answer.sampled)} lighter barriers sampled {lighter or 'none'} held",
        )
    )
    return found


def write_study(folder: Path, study: Study) -> None:
    """Write the table of the runs and what the study found, each whole or not at all."""
    write_whole(folder / RUNS, _as_csv(study_rows(study)))
    write_whole(folder / STUDY, json.dumps(finite(study_content(study)), indent=2, ensure_ascii=False) + "\n")


def study_rows(study: Study) -> list[dict[str, Any]]:
    """One row for each run: values of the fields, figures (SI), whether it keeps the limits."""
    names = list(dict.fromkeys([*(limit.name for limit in study.limits), *(one.name for one in study.told), *ALSO]))
    paths = [one.path for one in study.design.uncertain]
    found = []
    for values, run in zip(study.design.values, study.runs, strict=True):
        figures = run.figures or {}
        found.append(
            {
                **dict(zip(paths, map(float, values), strict=True)),
                **{name: figures.get(name) for name in names},
                **{f"keeps {limit.name}": limit.excess(figures) <= 0.0 for limit in study.limits},
                "spacing_m": run.scenario.numerics.spacing_m,
                "wall_time": run.wall_time,
                "problem": run.problem,
            }
        )
    return found


def study_content(study: Study) -> dict[str, Any]:
    """All that a study found as plain data, SI."""
    return {
        "scenario": study.design.scenario.title,
        "vary": {one.path: str(one.distribution) for one in study.design.uncertain},
        "runs": len(study.runs),
        "spacing_m": study.design.spacing,
        "samples": SAMPLES,
        "exceeded": [
            {
                "figure": one.limit.name,
                "bound": one.limit.bound,
                "least": one.limit.least,
                "probability": one.probability,
                "with_surrogate_error": [one.low, one.high],
                "of_runs": one.of_runs,
                "of_runs_95_percent": list(one.of_runs_interval),
            }
            for one in study.exceeded
        ],
        "figures": {
            one.name: {
                "unit": one.quantity.unit,
                "mean": one.mean,
                "quantiles": {f"{level:g}": value for level, value in one.quantiles.items()},
                "surrogate": one.surrogate.kind,
                "cross_validated_error": one.surrogate.error,
                "explained_variance": one.surrogate.explained,
                "sobol_first": dict(one.first),
                "sobol_total": dict(one.total),
            }
            for one in study.told
        },
        "not_counted": "the error of the coarse runs themselves, which is systematic",
        "remarks": study.remarks,
    }


def study_told(study: Study) -> list[tuple[str, str]]:
    """What a study found as rows of words and values."""
    found = []
    for one in study.exceeded:
        side = "below" if one.limit.least else "beyond"
        bound = one.limit.shown(one.limit.bound)
        found.append((f"probability of {one.limit.quantity.words} {side} {bound}", f"{one.probability:.2%}"))
        found.append(("  surrogate off by its error", f"{one.low:.2%} to {one.high:.2%}"))
        low, high = one.of_runs_interval
        found.append(("  of the runs themselves", f"{one.of_runs:.1%}; 95 % confidence {low:.1%} to {high:.1%}"))
    for told in study.told:
        quantity = told.quantity

        def text(value: float, quantity: Quantity = quantity) -> str:
            return quantity.text(value).removesuffix(" -")

        median = f"median {text(told.quantiles[0.5])}; 5 % above {text(told.quantiles[0.95])}"
        found.append((quantity.words, f"{median}; 1 % above {text(told.quantiles[0.99])}"))
        surrogate = told.surrogate
        found.append(
            (
                "  surrogate",
                f"{surrogate.kind}; off by {text(surrogate.error)} (cross-validated), {surrogate.explained:.1%}",
            )
        )
        order = sorted(told.total, key=lambda path: -told.total[path])
        found.append(("  depends on", ", ".join(f"{words(path)} {told.total[path]:.2f}" for path in order)))
    return found
