"""`python -m analytic field`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any

import typer

from analytic.cli.terminal import AsJson, Plot, check_plot, number, print_json, print_table, write_plot
from analytic.command_line import refusals


def field(
    events_file: Annotated[
        Path | None, typer.Argument(metavar="EVENTS", help="CSV file of events.", show_default=False)
    ] = None,
    model: Annotated[
        list[str] | None, typer.Option(help="Only this model; may be repeated.", show_default="all verified ones")
    ] = None,
    coefficient: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MODEL.NAME=VALUE", help="Your coefficient of a model; may be repeated.", show_default=False
        ),
    ] = None,
    models: Annotated[bool, typer.Option("--models", help="List the models with what is known of them.")] = False,
    as_json: AsJson = False,
    plot: Plot = None,
) -> None:
    """Hold pressure formulas against measured events.

    The file has the columns density [kg/m3], speed [m/s], height [m] and peak_pressure [kPa], with the units in the
    header. Slope: of the line through the origin that fits computed over measured pressures. Scatter: standard
    deviation of their ratio over its mean. Relative error: (computed - measured) / computed, as the paper has it.
    """
    with refusals():
        check_plot(plot)
        from analytic.empirical import select
        from analytic.field_data import SYNTHETIC, agreement, read_events

        if models:
            _list_models(as_json)
            return
        if events_file is None:
            raise ValueError("The file of events is missing; --models lists the models.")
        chosen = select(model or (), _coefficients(coefficient or []))
        events = read_events(events_file)
        found = [agreement(one, events) for one in chosen]
        mark = f"{SYNTHETIC} data, generated, not measured" if events.synthetic else "measured"
        rows, content = [], []
        for one in found:
            low, middle, high = _quantiles(one.relative_error)
            rows.append(
                [
                    one.model.title,
                    one.model.confidence.value,
                    number(one.slope),
                    number(one.scatter, 3),
                    *(f"{100 * value:.0f} %" for value in (low, middle, high)),
                ]
            )
            content.append(
                {
                    "model": one.model.name,
                    "confidence": one.model.confidence.value,
                    "coefficients": dict(one.model.coefficients),
                    "slope": one.slope,
                    "scatter": one.scatter,
                    "relative_error": {"0.05": low, "0.5": middle, "0.95": high},
                    "peak_pressure": one.pressure.tolist(),
                }
            )
        if as_json:
            print_json({"events": len(events), "synthetic": events.synthetic, "models": content})
        else:
            print_table(
                f"{len(events)} events of {events_file}: {mark}",
                ["model", "confidence", "slope", "scatter", "error 5 %", "median", "95 %"],
                rows,
                ["error: (computed - measured) / computed, which is at most 100 %."],
            )
        if plot is not None:
            write_plot(lambda: _figure(events, found), plot)


def _quantiles(values: Any) -> tuple[float, float, float]:
    import numpy as np

    low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
    return float(low), float(middle), float(high)


def _coefficients(texts: list[str]) -> dict[str, dict[str, float]]:
    """`MODEL.NAME=VALUE` texts by model."""
    found: dict[str, dict[str, float]] = {}
    for text in texts:
        parts = re.fullmatch(r"(\w+)\.(\w+)=(.+)", text)
        try:
            value = float(parts[3]) if parts else None
        except ValueError:
            value = None
        if not parts or value is None:
            raise ValueError(f"coefficient is {text!r}, it must read MODEL.NAME=VALUE with a number.")
        found.setdefault(parts[1], {})[parts[2]] = value
    return found


def _list_models(as_json: bool) -> None:
    from analytic.empirical import MODELS

    if as_json:
        names = ("name", "title", "formula", "source", "range", "remark", "on_by_default")
        print_json(
            [
                {name: getattr(model, name) for name in names}
                | {"coefficients": dict(model.coefficients), "confidence": model.confidence.value}
                for model in MODELS.values()
            ]
        )
        return
    rows = []
    for model in MODELS.values():
        values = ", ".join(
            f"{name} = {'yours' if value is None else f'{value:g}'}" for name, value in model.coefficients.items()
        )
        rows.append([model.name, model.formula, values or "–", model.confidence.value, model.range])
    print_table(
        "Peak pressure on a fixed barrier",
        ["model", "formula", "coefficients", "confidence", "range"],
        rows,
        [f"{model.title}: {model.remark}" for model in MODELS.values() if model.remark],
    )


def _figure(events: Any, found: Any) -> Any:
    from analytic import plots

    return plots.field(events, found)
