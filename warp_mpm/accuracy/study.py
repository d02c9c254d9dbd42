"""Which settings a study of accuracy runs: a ladder of spacings, each knob alone, ladders of combinations, effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from warp_mpm.accuracy.keys import run_key
from warp_mpm.effect_rules import with_law, without_liquid
from warp_mpm.scenario import DryFlow, Scenario, TwoPhaseFlow

SERIES_INTERVAL = 0.01
"""Interval of the forces [s]: a peak force is the greatest mean over it."""

QUICK_SPACINGS, FULL_SPACINGS = (2.0, 1.5, 1.0, 0.75), (2.0, 1.5, 1.0, 0.75, 0.5, 0.375, 0.25)
"""Spacings of the ladders over the scenario's own."""

QUICK_LADDER, FULL_LADDER = (2.5, 2.0, 1.5, 1.0), (2.5, 2.0, 1.5, 1.0, 0.75, 0.5)
"""The same for many scenes at once."""

COMBINATION_SPACINGS = (2.0, 1.5, 1.0)
"""Spacings of the ladders with one other setting changed, over the scenario's own."""

QUICK_KNOB_SPACING, FULL_KNOB_SPACING = 1.5, 1.0
"""Spacing over the scenario's own at which a knob is turned alone."""

KNOBS: Mapping[str, tuple[Any, ...]] = {
    "points_per_cell": (1, 4, 9, 16),
    "courant_number": (0.25, 0.5, 0.95),
    "transfer": ("aflip", "apic", "flip"),
    "transfer_damping": (0.1, 0.2, 0.4),
    "drag": ("semi_implicit", "explicit"),
    "volumetric_smoothing": (True, False),
    "pressure_relaxation": (0.0, 1.0, 2.0),
    "bulk_viscosity": (0.0, 0.2, 0.4),
    "density_correction": (0.0, 1.0),
    "precision": ("float64", "float32"),
}
"""Levels of each setting of `numerics` beside the spacing; the code has one kind of shape function, so no knob."""

COMBINATIONS: tuple[tuple[str, Any], ...] = (("points_per_cell", 1), ("points_per_cell", 9), ("transfer", "flip"))
FULL_COMBINATIONS: tuple[tuple[str, Any], ...] = (("bulk_viscosity", 0.0), ("volumetric_smoothing", False))
"""Settings that get a ladder of their own; the second line in a full study only."""

SPACING, DEFAULT = "spacing_m", "default"


@dataclass(frozen=True)
class Setting:
    """One run of a study."""

    name: str
    """As in the table: `spacing 0.2, courant_number 0.5`."""
    knob: str
    """What differs from the scenario beside the spacing: a setting's name, an effect's, or `default`."""
    level: Any
    """Its value; None for `default`."""
    scenario: Scenario
    physics: bool = False
    """True where an effect was left out: another question, not another way to answer it."""

    @property
    def spacing(self) -> float:
        """[m]."""
        return self.scenario.numerics.spacing_m

    @property
    def key(self) -> str:
        """Name of the result's file: the same for runs that give the same numbers."""
        return run_key(self.scenario)


def plan(scenario: Scenario, *, quick: bool) -> list[Setting]:
    """All runs of a study, none twice.

    Args:
        scenario: its numerics are the defaults around which the knobs are turned.
        quick: fewer and coarser.
    """
    own, base, flow = scenario.numerics.spacing_m, _bare(scenario), scenario.flow
    settings = ladder(scenario, [own * factor for factor in (QUICK_SPACINGS if quick else FULL_SPACINGS)])
    at = own * (QUICK_KNOB_SPACING if quick else FULL_KNOB_SPACING)
    for knob, levels in KNOBS.items():
        # Other formulations have no drag, and inertial drag is implicit alone: nothing to turn there.
        if knob == "drag" and (not isinstance(flow, TwoPhaseFlow) or flow.material.inertial_drag_coefficient > 0.0):
            continue
        for level in levels:
            if level != getattr(scenario.numerics, knob):
                # Explicit drag sets a time step that no spacing changes; it is dear enough on the coarsest grid.
                settings.append(_turned(base, knob, level, own * QUICK_SPACINGS[0] if level == "explicit" else at))
    for knob, level in COMBINATIONS + (() if quick else FULL_COMBINATIONS):
        if level != getattr(scenario.numerics, knob):
            settings += [_turned(base, knob, level, own * factor) for factor in COMBINATION_SPACINGS]
    for effect, other in without_effects(base).items():
        settings.append(Setting(f"{effect}, spacing {at:.4g}", effect, None, _at(other, at), physics=True))
    return list({setting.key: setting for setting in reversed(settings)}.values())[::-1]


def ladder(scenario: Scenario, spacings: Sequence[float]) -> list[Setting]:
    """The scenario's own settings at several spacings [m]."""
    base = _bare(scenario)
    return [Setting(f"spacing {spacing:.4g}", DEFAULT, None, _at(base, spacing)) for spacing in spacings]


def without_effects(scenario: Scenario) -> dict[str, Scenario]:
    """The scene with one effect left out at a time, by a name for it."""
    found: dict[str, Scenario] = {}
    flow = scenario.flow
    if isinstance(flow, TwoPhaseFlow):
        found["undrained"] = scenario.replaced(without_liquid(scenario))
    if not isinstance(flow, DryFlow):
        undrained = found.get("undrained", scenario)
        found["dry"] = undrained.replaced(without_liquid(undrained))
    if flow.material.law != "elastic":
        found["elastic"] = scenario.replaced(with_law(scenario, "elastic"))
    if scenario.barrier is not None and scenario.barrier.motion.kind == "sliding":
        found["fixed"] = scenario.replaced({"barrier.motion": {"kind": "fixed"}})
    return found


def _bare(scenario: Scenario) -> Scenario:
    """The scenario with the study's own output."""
    end = scenario.output.end_time_s
    return scenario.replaced(
        {
            "output.time_series_interval_s": min(SERIES_INTERVAL, end),
            "output.snapshot_interval_s": end,
            "output.checkpoint_interval_s": None,
        }
    )


def _round(spacing: float) -> float:
    """Without the last digits, which products of factors leave behind; 6 m / 17 stays a seventeenth of 6 m."""
    return float(f"{spacing:.12g}")


def _at(scenario: Scenario, spacing: float) -> Scenario:
    return scenario.replaced({"numerics.spacing_m": _round(spacing)})


def _turned(base: Scenario, knob: str, level: Any, spacing: float) -> Setting:
    scenario = _at(base, spacing).replaced({f"numerics.{knob}": level})
    return Setting(f"{knob} {level_text(level)}, spacing {spacing:.4g}", knob, level, scenario)


def level_text(level: Any) -> str:
    """A level as people write it."""
    if isinstance(level, bool):
        return "on" if level else "off"
    return f"{level:g}" if isinstance(level, float) else str(level)
