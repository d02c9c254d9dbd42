"""Which effects a scene calls for, and why: one rule per effect, read by the simulation and by the run card alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .effects import Effects
from .scenario import DryFlow, Scenario, TwoPhaseFlow
from .simulator.laws import LAWS
from .simulator.schemes import SCHEMES


@dataclass(frozen=True)
class Rule:
    """What a scene decides about one effect."""

    effect: str
    """Name of the field of `Effects`."""
    value: str | bool
    reason: str
    """Why, in the words of the scenario file."""
    switched: Mapping[str, Any] = field(default_factory=dict)
    """Changes of the scenario that switch the effect off, on, or to its other kind; empty where none does."""

    @property
    def on(self) -> bool:
        """Whether the effect is present."""
        return self.value not in (False, "none")


def derive_effects(scenario: Scenario) -> Effects:
    """The effects that `scenario` calls for, by the rules of `effect_rules`."""
    chosen: dict[str, Any] = {rule.effect: rule.value for rule in effect_rules(scenario)}
    return Effects(**chosen)


def effect_rules(scenario: Scenario) -> list[Rule]:
    """One rule per field of `Effects`: the flow, the numerics, the bodies."""
    return [*_material_rules(scenario), *_numerical_rules(scenario), *_body_rules(scenario)]


def _material_rules(scenario: Scenario) -> list[Rule]:
    flow = scenario.flow
    drag: str = scenario.numerics.drag if isinstance(flow, TwoPhaseFlow) else "none"
    two_phase = isinstance(flow, TwoPhaseFlow)
    inertial = flow.material.inertial_drag_coefficient if isinstance(flow, TwoPhaseFlow) else 0.0
    porosity = isinstance(flow, TwoPhaseFlow) and flow.material.porosity_update
    return [
        Rule("formulation", flow.formulation, f"flow.formulation = {flow.formulation}", without_liquid(scenario)),
        Rule("law", LAWS.key(flow.material.law), f"flow.material.law = {flow.material.law}", _another_law(scenario)),
        Rule(
            "drag",
            drag,
            f"two phases, numerics.drag = {drag}" if drag != "none" else "there are no two phases",
            {"numerics.drag": {"semi_implicit": "explicit", "explicit": "semi_implicit"}[drag]}
            if two_phase and not inertial
            else {},
        ),
        Rule(
            "inertial_drag",
            inertial > 0.0,
            f"flow.material.inertial_drag_coefficient = {inertial:g}" if two_phase else "there are no two phases",
            {"flow.material.inertial_drag_coefficient": 0.0 if inertial > 0.0 else 0.5}
            if drag == "semi_implicit"
            else {},
        ),
        Rule(
            "porosity_update",
            porosity,
            _setting("flow.material.porosity_update", porosity) if two_phase else "there are no two phases",
            {"flow.material.porosity_update": not porosity} if two_phase else {},
        ),
        Rule(
            "arriving",
            flow.inflow is not None,
            "all of the flow is there at the start"
            if flow.inflow is None
            else f"flow.inflow brings {flow.inflow.volume:.4g} m³/m",
        ),
        Rule(
            "materials",
            len(flow.materials) > 1,
            "a deposit has a material of its own" if len(flow.materials) > 1 else "all have the flow's material",
        ),
    ]


def _numerical_rules(scenario: Scenario) -> list[Rule]:
    numerics = scenario.numerics
    liquid = not isinstance(scenario.flow, DryFlow)
    corrected = numerics.density_correction > 0.0 and numerics.volumetric_smoothing
    relaxation = f"numerics.pressure_relaxation = {numerics.pressure_relaxation:g}"
    return [
        Rule(
            "precision",
            numerics.precision,
            f"numerics.precision = {numerics.precision}",
            {"numerics.precision": "float32" if numerics.precision == "float64" else "float64"},
        ),
        Rule(
            "volumetric_smoothing",
            numerics.volumetric_smoothing,
            _setting("numerics.volumetric_smoothing", numerics.volumetric_smoothing),
            {"numerics.volumetric_smoothing": not numerics.volumetric_smoothing},
        ),
        Rule(
            "density_correction",
            corrected,
            f"numerics.density_correction = {numerics.density_correction:g}"
            if numerics.volumetric_smoothing
            else "numerics.volumetric_smoothing = false",
            {"numerics.density_correction": 0.0 if corrected else 1.0} if numerics.volumetric_smoothing else {},
        ),
        Rule(
            "pressure_relaxation",
            liquid and numerics.pressure_relaxation > 0.0,
            relaxation if liquid else "there is no liquid",
            {"numerics.pressure_relaxation": 0.0 if numerics.pressure_relaxation > 0.0 else 1.0} if liquid else {},
        ),
        Rule(
            "bulk_viscosity",
            numerics.bulk_viscosity > 0.0,
            f"numerics.bulk_viscosity = {numerics.bulk_viscosity:g}",
            {"numerics.bulk_viscosity": 0.0 if numerics.bulk_viscosity > 0.0 else 0.2},
        ),
        Rule(
            "transfer",
            SCHEMES.key(numerics.transfer),
            f"numerics.transfer = {numerics.transfer}",
            {"numerics.transfer": next(name for name in SCHEMES.names if name != numerics.transfer)},
        ),
    ]


def _body_rules(scenario: Scenario) -> list[Rule]:
    barrier, ground, domain = scenario.barrier, scenario.ground, scenario.domain
    kind = "none" if barrier is None else barrier.motion.kind
    why_moves = "there is no barrier" if barrier is None else f"barrier.motion.kind = {kind}"
    fixed = {"barrier.motion": {"kind": "fixed"}}
    edges = [
        f"domain.{name} = wall" for name in ("left_edge", "right_edge", "top_edge") if getattr(domain, name) == "wall"
    ]
    solid = [name for name, there in (("ground", ground), ("barrier", barrier)) if there is not None] + edges
    frictions, rough, smooth = [], {}, {}
    if barrier is not None:
        greatest = max(barrier.friction.face, barrier.friction.top, barrier.friction.back)
        frictions.append((greatest, f"the greatest of barrier.friction is {greatest:g}"))
        rough["barrier.friction"], smooth["barrier.friction"] = 0.3, 0.0
    if ground is not None:
        frictions.append((ground.friction, f"ground.friction = {ground.friction:g}"))
        rough["ground.friction"], smooth["ground.friction"] = 0.3, 0.0
    rubs = any(friction > 0.0 for friction, _ in frictions)
    passing = kind in ("sliding", "prescribed") and any("top" not in edge for edge in edges)
    return [
        Rule("bodies", bool(solid), ", ".join(solid) if solid else "nothing solid is there"),
        Rule(
            "friction",
            rubs,
            ", ".join(why for friction, why in frictions if friction > 0.0 or not rubs) or "nothing solid is there",
            smooth if rubs else rough,
        ),
        Rule("sliding", kind == "sliding", why_moves, fixed if kind == "sliding" else {}),
        Rule("driven", kind == "prescribed", why_moves, fixed if kind == "prescribed" else {}),
        Rule(
            "joined",
            barrier is not None or bool(edges),
            ", ".join(solid[1 if ground is not None else 0 :]) + " beside the ground"
            if ground is not None and len(solid) > 1
            else ", ".join(solid) + " alone"
            if solid
            else "nothing solid is there",
        ),
        Rule(
            "passing",
            passing,
            "the grid rides with the barrier past the domain's walls"
            if passing
            else "the grid rests or passes nothing",
        ),
    ]


def without_liquid(scenario: Scenario) -> dict[str, Any]:
    """Changes that make a two-phase flow undrained, and an undrained one dry; none for a dry one."""
    flow = scenario.resolved()["flow"]
    material = flow["material"]
    if isinstance(scenario.flow, DryFlow):
        return {}
    dropped = {
        "hydraulic_conductivity_m_per_s",
        "intrinsic_permeability_m2",
        "liquid_viscosity_Pa_s",
        "inertial_drag_coefficient",
        "porosity_update",
    }
    formulation = "undrained"
    if not isinstance(scenario.flow, TwoPhaseFlow):
        dropped = {"liquid_density_kg_per_m3", "liquid_bulk_modulus_Pa", "cavitation_pressure_Pa"}
        formulation = "dry"
    kept = {name: value for name, value in material.items() if name not in dropped}
    return {"flow": flow | {"formulation": formulation, "material": kept}}


def with_law(scenario: Scenario, law: str, **own: Any) -> dict[str, Any]:
    """Changes that give the skeleton another law and leave all else, the initial stress too, as it is.

    Args:
        scenario: the scene.
        law: name of the other one.
        own: its fields; what is left out has its default.
    """
    flow = scenario.resolved()["flow"]
    dropped = {"law", *LAWS.named(scenario.flow.material.law).Settings.model_fields}
    kept = {name: value for name, value in flow["material"].items() if name not in dropped}
    changed = {"lateral_stress_coefficient": scenario.flow.lateral_stress_ratio}
    return {"flow": flow | changed | {"material": kept | {"law": law, **own}}}


def _another_law(scenario: Scenario) -> dict[str, Any]:
    """Changes to the first other law that needs no figure which the scene does not give; none where there is none."""
    for law in LAWS:
        needed = any(field.is_required() for field in law.Settings.model_fields.values())
        if law.name != scenario.flow.material.law and not needed:
            return with_law(scenario, law.name)
    return {}


def _setting(name: str, value: bool) -> str:
    return f"{name} = {'true' if value else 'false'}"
