"""Which settings a study of accuracy runs: a ladder of spacings, each knob alone, ladders of combinations, effects, and
what the reference's uncertainty is taken from: all that the ladder shares, refined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from warp_mpm.accuracy.keys import run_key
from warp_mpm.accuracy.measure import SERIES_INTERVAL
from warp_mpm.effect_rules import with_law, without_liquid
from warp_mpm.scenario import DryFlow, Scenario, TwoPhaseFlow
from warp_mpm.simulator.schemes import SCHEMES

QUICK_SPACINGS, FULL_SPACINGS = (2.0, 1.5, 1.0, 0.75), (2.0, 1.5, 1.0, 0.75, 0.5, 0.375, 0.25)
"""Spacings of the ladders over the scenario's own."""

QUICK_LADDER, FULL_LADDER = (2.5, 2.0, 1.5, 1.0), (2.5, 2.0, 1.5, 1.0, 0.75, 0.5)
"""The same for many scenes at once."""

COMBINATION_SPACINGS = (2.0, 1.5, 1.0)
"""Spacings of the ladders with one other setting changed, over the scenario's own."""

KNOB_SPACING = 1.5
"""Spacing over the scenario's own at which a knob is turned alone."""

REFINED_SPACINGS, FULL_REFINED_SPACINGS = (2.0, 4.0), (3.0, 6.0)
"""Spacings over the finest of the ladder, at the least, at which what the ladder shares is refined: at the first each
setting alone and all at once, at the second all at once. The other pair is a full study's, whose finest runs are dear.
"""

HALVED = ("courant_number", "pressure_relaxation", "bulk_viscosity", "density_correction")
"""Settings of `numerics` that a ladder of spacings shares, and that are refined by halving: the time step, filters."""

LOSSES = ("transfer_damping", "pic_share")
"""The same of the transfer schemes, each where the scheme in use has it."""

POINTS = (1, 4, 9, 16)
"""Points per cell that there are; the next number is the refined one."""

INTERVAL, EVERYTHING = "record_interval", "everything"
"""What is refined beside settings of `numerics`: the interval of records, which cut steps short, and all at once."""

KNOBS: Mapping[str, tuple[Any, ...]] = {
    "points_per_cell": POINTS,
    "courant_number": (0.25, 0.5, 0.95),
    "transfer": ("aflip", "apic", "flip"),
    "transfer_damping": (0.1, 0.2, 0.4),
    "drag": ("semi_implicit", "explicit"),
    "volumetric_smoothing": (True, False),
    "pressure_relaxation": (0.0, 0.2, 1.0),
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
    refined: bool = False
    """True where `knob` was refined to see what it does to the reference: no choice that is weighed against others."""

    @property
    def spacing(self) -> float:
        """[m]."""
        return self.scenario.numerics.spacing_m

    @property
    def key(self) -> str:
        """Name of the result's file: the same for runs that give the same numbers."""
        return run_key(self.scenario)


def plan(scenario: Scenario, *, quick: bool) -> list[Setting]:
    """All runs of a study, none twice; one that is refined may be a choice as well.

    Args:
        scenario: its numerics are the defaults around which the knobs are turned.
        quick: fewer and coarser.
    """
    own, base, flow = scenario.numerics.spacing_m, _bare(scenario), scenario.flow
    settings = ladder(scenario, [own * factor for factor in (QUICK_SPACINGS if quick else FULL_SPACINGS)])
    shared = refined(
        scenario, [setting.spacing for setting in settings], REFINED_SPACINGS if quick else FULL_REFINED_SPACINGS
    )
    at = own * KNOB_SPACING
    for knob, levels in KNOBS.items():
        # Other formulations have no drag, and some drag is implicit alone: nothing to turn there.
        if knob == "drag" and not (isinstance(flow, TwoPhaseFlow) and flow.material.may_be_explicit):
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
    return list({setting.key: setting for setting in reversed(settings)}.values())[::-1] + shared


def ladder(scenario: Scenario, spacings: Sequence[float]) -> list[Setting]:
    """The scenario's own settings at several spacings [m]."""
    base = _bare(scenario)
    return [Setting(f"spacing {spacing:.4g}", DEFAULT, None, _at(base, spacing)) for spacing in spacings]


def known_ladder(scenario: Scenario, spacings: Sequence[float]) -> list[Setting]:
    """A ladder, and what tells how far its answer is known; see `refined`."""
    return ladder(scenario, spacings) + refined(scenario, spacings)


def refinements(scenario: Scenario) -> dict[str, dict[str, Any]]:
    """What refines each setting that a ladder of spacings shares, by the setting's name: changes of the scenario.

    The time step, the loss of the transfer and the strength of the filters are halved, points are made more, records
    denser; `EVERYTHING` is all of that at once. What is off stays off.
    """
    numerics = scenario.numerics
    own = [name for name in LOSSES if name in SCHEMES.named(numerics.transfer).settings.model_fields]
    halved = [name for name in (*HALVED, *own) if getattr(numerics, name) > 0.0]
    if not numerics.volumetric_smoothing and "density_correction" in halved:
        halved.remove("density_correction")  # it has nothing to work on
    found: dict[str, dict[str, Any]] = {name: {f"numerics.{name}": 0.5 * getattr(numerics, name)} for name in halved}
    more = [number for number in POINTS if number > numerics.points_per_cell]
    if more:
        found["points_per_cell"] = {"numerics.points_per_cell": more[0]}
    interval = scenario.output.time_series_interval_s
    found[INTERVAL] = {"output.time_series_interval_s": 0.5 * interval}
    return found | {EVERYTHING: {path: value for change in found.values() for path, value in change.items()}}


def refined(
    scenario: Scenario, spacings: Sequence[float], factors: Sequence[float] = REFINED_SPACINGS
) -> list[Setting]:
    """Runs that tell what the settings do that a ladder of these spacings [m] shares.

    Each has the spacing of a rung, against which it is held: the next one at or above a factor times the finest, with
    each setting refined alone, and all of them, at the first factor, and all of them at the second.
    """
    base, finest = _bare(scenario), min(spacings)
    changes = refinements(base)
    settings = []
    for factor, names in zip(factors, ([*changes], [EVERYTHING]), strict=True):
        at = min((one for one in spacings if one >= factor * finest * (1.0 - 1e-9)), default=max(spacings))
        settings += [_refined(base, name, changes[name], at) for name in names]
    return list({setting.key: setting for setting in settings}.values())


def refined_everything(scenario: Scenario, spacing: float) -> Setting:
    """All that a ladder shares refined at once, at a spacing [m]."""
    base = _bare(scenario)
    return _refined(base, EVERYTHING, refinements(base)[EVERYTHING], spacing)


def _refined(base: Scenario, name: str, changes: Mapping[str, Any], spacing: float) -> Setting:
    level = None if name == EVERYTHING else next(iter(changes.values()))
    text = f"{name} refined" if level is None else f"{name} {level_text(level)}"
    return Setting(
        f"{text}, spacing {spacing:.4g}", name, level, _at(base, spacing).replaced(dict(changes)), refined=True
    )


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
