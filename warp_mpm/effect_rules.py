"""Which effects a scene calls for, and why: one rule per effect, read by the simulation and by the run card alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .effects import Effects, Kind
from .scenario import DryFlow, Ground, Scenario, Skeleton, TwoPhaseFlow, TwoPhaseMaterial, UndrainedMaterial
from .scenario.material import formulation_of
from .scenario.other_material import OtherMaterial
from .simulator.bodies.of_scene import ground_body
from .simulator.bodies.outline import FEW
from .simulator.laws import LAWS
from .simulator.schemes import SCHEMES


@dataclass(frozen=True)
class Rule:
    """What a scene decides about one effect."""

    effect: str
    """Name of the field of `Effects`."""
    value: str | bool | tuple[Kind, ...]
    reason: str
    """Why, in the words of the scenario file."""
    switched: Mapping[str, Any] = field(default_factory=dict)
    """Changes of the scenario that switch the effect off, on, or to its other kind; empty where none does."""

    @property
    def on(self) -> bool:
        """Whether the effect is present."""
        return self.value not in (False, "none", "constant", ())


def derive_effects(scenario: Scenario) -> Effects:
    """The effects that `scenario` calls for, by the rules of `effect_rules`."""
    chosen: dict[str, Any] = {rule.effect: rule.value for rule in effect_rules(scenario)}
    return Effects(**chosen)


def effect_rules(scenario: Scenario) -> list[Rule]:
    """One rule per field of `Effects`: the flow, the numerics, the bodies."""
    return [*_material_rules(scenario), *_numerical_rules(scenario), *_body_rules(scenario)]


def _material_rules(scenario: Scenario) -> list[Rule]:
    flow, materials = scenario.flow, scenario.flow.materials
    wettest = flow.wettest
    formulation = flow.wettest_formulation
    two_phase = isinstance(wettest, TwoPhaseMaterial)
    drag: str = scenario.numerics.drag if two_phase else "none"
    inertial = max(getattr(material, "inertial_drag_coefficient", 0.0) for material in materials)
    porosity = isinstance(wettest, TwoPhaseMaterial) and wettest.porosity_update
    conductivity = wettest.conductivity_law if isinstance(wettest, TwoPhaseMaterial) else "constant"
    dilatancy = next((material.dilatancy for material in materials if material.dilatancy is not None), None)
    kinds = tuple(dict.fromkeys(kind_of(material) for material in materials))
    porosities = {one.porosity for one in materials if isinstance(one, TwoPhaseMaterial)}
    differ = formulation != "dry" and len({_told_to_nodes(material) for material in materials}) > 1
    return [
        Rule(
            "formulation",
            formulation,
            f"flow.formulation = {flow.formulation}"
            if formulation == flow.formulation
            else f"another material has the formulation {formulation}",
            without_liquid(scenario),
        ),
        Rule("law", LAWS.key(flow.material.law), f"flow.material.law = {flow.material.law}", _another_law(scenario)),
        Rule(
            "drag",
            drag,
            f"two phases, numerics.drag = {drag}" if drag != "none" else "there are no two phases",
            {"numerics.drag": {"semi_implicit": "explicit", "explicit": "semi_implicit"}[drag]}
            if all(getattr(material, "may_be_explicit", True) for material in materials) and two_phase
            else {},
        ),
        Rule(
            "inertial_drag",
            inertial > 0.0,
            f"flow.material.inertial_drag_coefficient = {inertial:g}" if two_phase else "there are no two phases",
            {"flow.material.inertial_drag_coefficient": 0.0 if inertial > 0.0 else 0.5}
            if drag == "semi_implicit" and len(materials) == 1
            else {},
        ),
        Rule(
            "porosity_update",
            porosity,
            _setting("flow.material.porosity_update", porosity) if two_phase else "there are no two phases",
            {"flow.material.porosity_update": not porosity}
            if two_phase and conductivity == "constant" and len(materials) == 1
            else {},
        ),
        Rule(
            "conductivity",
            conductivity,
            f"flow.material.conductivity_law = {conductivity}" if two_phase else "there are no two phases",
            {"flow.material.conductivity_law": "kozeny_carman" if conductivity == "constant" else "constant"}
            if porosity and drag == "semi_implicit" and len(materials) == 1
            else {},
        ),
        Rule(
            "dilatancy",
            dilatancy is not None,
            "flow.material.dilatancy is not given"
            if dilatancy is None
            else f"flow.material.dilatancy.coefficient = {dilatancy.coefficient:g}",
            {"flow.material.dilatancy": None} if dilatancy is not None and len(materials) == 1 else {},
        ),
        Rule(
            "materials",
            differ,
            "masses per volume or drag differ between materials"
            if differ
            else "one material"
            if len(materials) == 1
            else "the nodes need no material's own numbers",
        ),
        Rule(
            "unlike_porosity",
            len(porosities) > 1,
            f"wet materials of two phases have porosities from {min(porosities):g} to {max(porosities):g}"
            if len(porosities) > 1
            else "there are no two phases"
            if not porosities
            else "all that is wet has one porosity",
        ),
        Rule(
            "kinds",
            kinds if len(kinds) > 1 else (),
            "laws, or what is wet, differ between materials" if len(kinds) > 1 else "one kind of material",
        ),
        Rule(
            "arriving",
            flow.inflow is not None,
            "all of the flow is there at the start"
            if flow.inflow is None
            else f"flow.inflow brings {flow.inflow.volume:.4g} m³/m",
        ),
    ]


def kind_of(material: Skeleton) -> Kind:
    """The kind of a material, by which kernels are compiled."""
    return Kind(LAWS.key(material.law), formulation_of(material) != "dry", material.dilatancy is not None)


def _told_to_nodes(material: Skeleton) -> tuple[float, ...]:
    """What nodes sum up of a material, per mass of what moves with the solid, where it differs between materials."""
    if not isinstance(material, UndrainedMaterial):
        return ()
    if not isinstance(material, TwoPhaseMaterial):
        return (material.liquid_density_kg_per_m3 / material.density,)
    solid = material.solid_partial_density
    return (
        material.liquid_density_kg_per_m3 / solid,
        material.liquid_partial_density / solid,
        material.intrinsic_permeability,
        material.hydraulic_conductivity,
        material.inertial_drag_coefficient,
        material.porosity,
    )


def _numerical_rules(scenario: Scenario) -> list[Rule]:
    numerics = scenario.numerics
    liquid = scenario.flow.wettest_formulation != "dry"
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
    ground, domain = scenario.ground, scenario.domain
    barriers = {"barrier": scenario.barrier} if scenario.barrier is not None else {}
    barriers |= {f"barriers[{number}]": one for number, one in enumerate(scenario.barriers)}
    kinds = {name: barrier.motion.kind for name, barrier in barriers.items()}
    edges = [
        f"domain.{name} = wall" for name in ("left_edge", "right_edge", "top_edge") if getattr(domain, name) == "wall"
    ]
    solid = [*(["ground"] if ground is not None else []), *barriers, *edges]
    frictions: list[tuple[float, str]] = []
    rough: dict[str, Any] = {}
    smooth: dict[str, Any] = {}
    for name, barrier in barriers.items():
        greatest = max(barrier.friction.face, barrier.friction.top, barrier.friction.back)
        frictions.append((greatest, f"the greatest of {name}.friction is {greatest:g}"))
    if scenario.barrier is not None:
        rough["barrier.friction"], smooth["barrier.friction"] = 0.3, 0.0
    if ground is not None:
        frictions.append((ground.friction, f"ground.friction = {ground.friction:g}"))
        if ground.stretches:
            roughest = max(stretch.friction for stretch in ground.stretches)
            frictions.append((roughest, f"the greatest of ground.stretches is {roughest:g}"))
        rough["ground.friction"], smooth["ground.friction"] = 0.3, 0.0
    turbulent = ground is not None and any(drag > 0.0 for drag in ground.drags)
    if turbulent:
        frictions.append((1.0, "the ground's friction grows with the speed"))
        smooth["ground.turbulence_m_per_s2"] = None
    rubs = any(friction > 0.0 for friction, _ in frictions)
    moves = any(kind in ("sliding", "prescribed") for kind in kinds.values())
    past = moves and any("top" not in edge for edge in edges)
    profile = ground is not None and not ground.level
    joined = bool(barriers) or bool(edges) or profile

    def why_moves(kind: str) -> tuple[bool, str, dict[str, Any]]:
        """Whether a barrier moves so, the reason, and what switches it off."""
        own = [name for name, one in kinds.items() if one == kind]
        told = own or list(kinds)[:1]
        reason = ", ".join(f"{name}.motion.kind = {kinds[name]}" for name in told) or "there is no barrier"
        return bool(own), reason, {"barrier.motion": {"kind": "fixed"}} if own == ["barrier"] else {}

    return [
        Rule("bodies", bool(solid), ", ".join(solid) if solid else "nothing solid is there"),
        Rule(
            "friction",
            rubs,
            ", ".join(why for friction, why in frictions if friction > 0.0 or not rubs) or "nothing solid is there",
            _switch_friction(scenario, smooth if rubs else rough, rubs),
        ),
        Rule(
            "turbulence",
            turbulent,
            "there is no ground" if ground is None else _told_turbulence(ground),
            {"ground.turbulence_m_per_s2": None if turbulent else 500.0}
            if ground is not None and not ground.stretches
            else {},
        ),
        Rule("sliding", *why_moves("sliding")),
        Rule("driven", *why_moves("prescribed")),
        Rule(
            "joined",
            joined,
            "the ground has a profile"
            if profile
            else ", ".join(solid[1 if ground is not None else 0 :]) + " beside the ground"
            if ground is not None and len(solid) > 1
            else ", ".join(solid) + " alone"
            if solid
            else "nothing solid is there",
        ),
        Rule(
            "passing",
            moves and (past or not scenario.plain),
            "a barrier moves over a grid that rests"
            if moves and not scenario.plain
            else "the grid rides with the barrier past the domain's walls"
            if past
            else "the grid rests or passes nothing",
        ),
        Rule("profile", *_many_pieces(scenario)),
    ]


def _told_turbulence(ground: Ground) -> str:
    """Where the ground's friction grows with the speed."""
    if not any(ground.drags):
        return "ground.turbulence_m_per_s2 is not given"
    return "ground.turbulence_m_per_s2 = " + ", ".join(
        f"{1.0 / drag:g}" for drag in dict.fromkeys(ground.drags) if drag
    )


def _many_pieces(scenario: Scenario) -> tuple[bool, str]:
    """Whether the ground has so many pieces that points look for those about them, and why."""
    if scenario.ground is None or scenario.ground.level:
        return False, "the ground is level" if scenario.ground is not None else "there is no ground"
    pieces = len(ground_body(scenario.ground).outline.segments)
    return pieces > FEW, f"the ground has {pieces} {'piece' if pieces == 1 else 'pieces'}"


def _switch_friction(scenario: Scenario, changes: dict[str, Any], rubs: bool) -> dict[str, Any]:
    """The changes, where they switch friction off or on as a whole."""
    ground = scenario.ground
    further = bool(scenario.barriers) or (ground is not None and bool(ground.stretches))
    return {} if rubs and further else changes


def without_liquid(scenario: Scenario) -> dict[str, Any]:
    """Changes that make a two-phase flow undrained, and an undrained one dry; none for a dry one, nor where materials
    differ."""
    if len(scenario.flow.materials) > 1:
        return {}
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
        "conductivity_law",
        "conductivity_scale",
    }
    formulation = "undrained"
    if not isinstance(scenario.flow, TwoPhaseFlow):
        dropped = {"liquid_density_kg_per_m3", "liquid_bulk_modulus_Pa", "cavitation_pressure_Pa"}
        formulation = "dry"
    kept = {name: value for name, value in material.items() if name not in dropped}
    return {"flow": flow | {"formulation": formulation, "material": kept}}


def with_law(scenario: Scenario, law: str, **own: Any) -> dict[str, Any]:
    """Changes that give the skeleton another law and leave all else, the initial stress too, as it is; what has a
    material of its own keeps of it what is no field of a law.

    Args:
        scenario: the scene.
        law: name of the other one.
        own: its fields; what is left out has its default.
    """
    flow = scenario.resolved()["flow"]
    dropped = {"law", *LAWS.named(scenario.flow.material.law).Settings.model_fields}
    if not LAWS.named(law).dilates:
        dropped.add("dilatancy")
    kept = {name: value for name, value in flow["material"].items() if name not in dropped}
    changed: dict[str, Any] = {"lateral_stress_coefficient": scenario.flow.lateral_stress_ratio}
    inflow = scenario.flow.inflow
    others: list[tuple[OtherMaterial, Any]] = [*zip(scenario.flow.deposits, flow["deposits"], strict=True)]
    if inflow is not None:
        others += [(inflow, flow["inflow"]), *zip(inflow.surges, flow["inflow"]["surges"], strict=True)]
    for body, there in others:
        material = scenario.flow.material_of(body)
        if body.material and body.lateral_stress_coefficient is None:
            there["lateral_stress_coefficient"] = LAWS.named(material.law).lateral_stress_ratio(material)
        gone = dropped | set(LAWS.named(material.law).Settings.model_fields)
        said = {name: value for name, value in (body.material or {}).items() if name not in gone}
        there["material"] = said or None
    return {"flow": flow | changed | {"material": kept | {"law": law, **own}}}


def _another_law(scenario: Scenario) -> dict[str, Any]:
    """Changes to the first other law that needs no figure which the scene does not give; none where there is none, nor
    where materials differ."""
    if len(scenario.flow.materials) > 1:
        return {}
    for law in LAWS:
        needed = any(field.is_required() for field in law.Settings.model_fields.values())
        if law.name != scenario.flow.material.law and not needed:
            return with_law(scenario, law.name)
    return {}


def _setting(name: str, value: bool) -> str:
    return f"{name} = {'true' if value else 'false'}"
