"""Scenes drawn at random from wide but legal ranges: none may be unstable. Each failure found becomes a named case.

Hypothesis draws by constants that it finds in the code, so that a change of the code draws other scenes: the search is
run with `slow`, and what it has found is in the collection.
"""

from functools import partial
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, note, settings
from hypothesis import strategies as st

from warp_mpm.hard_cases.measure import measure
from warp_mpm.scenario import Scenario
from warp_mpm.simulator.laws.mohr_coulomb import MohrCoulomb

BASE = Scenario.load(Path(__file__).parents[2] / "scenarios" / "case_1.json")


def logarithmic(low, high):
    """Powers of ten between two exponents."""
    return st.floats(low, high).map(lambda exponent: float(10.0**exponent))


def zero_or(low, high):
    """Nil, or a power of ten between two exponents."""
    return st.one_of(st.just(0.0), logarithmic(low, high))


LAWS = ["mohr_coulomb", "herschel_bulkley", "coulomb_viscous", "mu_i"]


def scenes(formulations, precisions, transfers):
    @st.composite
    def draw_scene(draw):
        pick = partial(st.floats, allow_nan=False, allow_infinity=False)
        formulation = draw(st.sampled_from(formulations))
        depth = draw(pick(1.0, 4.0))
        height = draw(pick(0.5, 8.0))
        data = BASE.resolved()
        flow, material = data["flow"], data["flow"]["material"]
        flow["formulation"] = formulation
        flow["shape"] = {
            "kind": "front_and_tail",
            "depth_m": depth,
            "squares": draw(st.integers(0, 4)),
            "distance_m": draw(pick(0.0, 3.0)),
        }
        flow["velocity_m_per_s"] = [draw(pick(-5.0, 50.0)), draw(pick(-5.0, 5.0))]
        flow["lateral_stress_coefficient"] = None
        flow["initial_stress"] = draw(st.sampled_from(["geostatic", "zero"]))
        for name in MohrCoulomb.Settings.model_fields:
            del material[name]
        law = draw(st.sampled_from(LAWS))
        material |= {
            "porosity": draw(pick(0.05, 0.9)),
            "young_modulus_Pa": draw(logarithmic(5, 8.3)),
            "poisson_ratio": draw(pick(0.0, 0.45)),
            "law": law,
        }
        if law in ("mohr_coulomb", "coulomb_viscous"):
            friction_angle, cohesion = draw(pick(0.0, 45.0)), draw(zero_or(2, 5))
            material |= {
                "friction_angle_deg": friction_angle,
                "dilatancy_angle_deg": draw(pick(0.0, 0.3)) * friction_angle,
                "cohesion_Pa": cohesion,
                "tension_cutoff_Pa": draw(st.sampled_from([0.0, 0.5])) * cohesion,
            }
        if law == "coulomb_viscous":
            material["mixture_viscosity_Pa_s"] = draw(zero_or(-3, 6))
        if law == "herschel_bulkley":
            material |= {
                "yield_stress_Pa": draw(zero_or(0, 6)),
                "consistency_Pa_s": draw(zero_or(-3, 6)),
                "flow_exponent": draw(pick(0.2, 2.0)),
                "tension_cutoff_Pa": draw(st.sampled_from([0.0, 1e3])),
            }
        if law == "mu_i":
            static = draw(pick(0.0, 1.0))
            material |= {
                "static_friction": static,
                "dynamic_friction": static + draw(pick(0.0, 1.0)),
                "inertial_constant": draw(zero_or(-3, 1)),
                "grain_diameter_m": draw(logarithmic(-5, 0)),
                "fluid_viscosity_Pa_s": draw(st.one_of(st.none(), zero_or(-3, 3))),
            }
        if law != "herschel_bulkley" and draw(st.booleans()):
            if law != "mu_i":
                material["dilatancy_angle_deg"] = 0.0
            material["dilatancy"] = {
                # Loose or dense by what soils are, and by what none is.
                "critical_solid_fraction": min(max(1.0 - material["porosity"] + draw(pick(-0.3, 0.3)), 0.01), 0.99),
                "coefficient": draw(zero_or(-1, 2)),
                "grain_diameter_m": draw(logarithmic(-5, 0)),
            }
        wet = ["liquid_density_kg_per_m3", "liquid_bulk_modulus_Pa", "cavitation_pressure_Pa"]
        drained = ["hydraulic_conductivity_m_per_s", "intrinsic_permeability_m2", "liquid_viscosity_Pa_s"]
        if formulation == "two_phase":
            material["hydraulic_conductivity_m_per_s"] = draw(logarithmic(-9, 1))
            material["inertial_drag_coefficient"] = draw(st.sampled_from([0.0, 0.4, 100.0]))
            material["conductivity_law"] = draw(st.sampled_from(["constant", "kozeny_carman", "exponential"]))
            material["conductivity_scale"] = draw(pick(0.005, 0.1))
            material["porosity_update"] = material["conductivity_law"] != "constant" or draw(st.booleans())
        if formulation != "dry":
            material["liquid_bulk_modulus_Pa"] = draw(logarithmic(6, 8.5))
            if flow["initial_stress"] == "geostatic":
                start = draw(st.sampled_from(["", "initial_pore_pressure_ratio", "initial_pore_pressure_ratios"]))
                if start:
                    tail, front = draw(pick(0.0, 1.0)), draw(pick(0.0, 1.0))
                    flow[start] = tail if start.endswith("ratio") else [[-10.0, tail], [0.0, front]]
        drained += ["inertial_drag_coefficient", "porosity_update", "conductivity_law", "conductivity_scale"]
        for name in drained * (formulation != "two_phase") + wet * (formulation == "dry"):
            material.pop(name, None)
        flow["base_velocity_share"] = draw(st.one_of(st.just(1.0), pick(0.0, 1.0)))
        flow["velocity_exponent"] = draw(pick(0.1, 3.0))
        volume = (2 + flow["shape"]["squares"]) * depth**2
        data["barrier"] = {
            "shape": {
                "kind": "trapezoid",
                "crest_width_m": draw(pick(1e-3, 5.0)),
                "height_m": height,
                "face_angle_deg": draw(st.one_of(pick(20.0, 90.0), st.just(90.0))),
            },
            "motion": {
                "kind": "sliding",
                "mass_kg_per_m": 1800.0 * volume * draw(logarithmic(-3, 6)),
                "base_friction": draw(pick(0.0, 1.0)),
            },
            "friction": draw(pick(0.01, 1.0)),
        }
        data["ground"] = {
            "friction": draw(pick(0.01, 1.0)),
            "turbulence_m_per_s2": draw(st.one_of(st.none(), logarithmic(1, 4))),
        }
        data["gravity"] = {"acceleration_m_per_s2": draw(pick(0.0, 20.0)), "tilt_deg": draw(pick(-20.0, 30.0))}
        data["numerics"] |= {
            "spacing_m": draw(pick(0.3, 0.8)),
            "points_per_cell": draw(st.sampled_from([1, 4, 9])),
            "courant_number": draw(pick(0.3, 0.99)),
            "precision": draw(st.sampled_from(precisions)),
            "transfer": draw(st.sampled_from(transfers)),
        }
        data["output"] = {"end_time_s": 1.0, "time_series_interval_s": 0.01, "snapshot_interval_s": 0.05}
        return data

    return draw_scene()


def assert_stable(data):
    scenario = Scenario.model_validate(data)
    measured = measure(scenario)
    note(scenario.model_dump_json())
    assert measured.problem is None, measured.problem
    unmet = {criterion.figure: value for criterion, value in measured.failures(scenario)}
    if "energy_error" in unmet:
        # What crowds is compressed against its own pressure, and friction alone takes that energy: docs/limits.md. The
        # most that 1,085 scenes had was 1.07 times what there was.
        plain = measure(scenario.replaced({"numerics.density_correction": 0.0}))
        of_plain = {criterion.figure for criterion, _ in plain.failures(scenario)}
        if unmet["energy_error"] < 1.5 and "energy_error" not in of_plain:
            del unmet["energy_error"]
    assert not {name: value for name, value in unmet.items() if name not in no_matter_of_stability(scenario)}
    assert measured.figures.get("stress_ratio", 0.0) < 10.0


def no_matter_of_stability(scenario):
    """Figures that depend on how many cells and points a scene is given, or how much of it flies, and not on whether
    it is stable: a pressure's noise on three cells, points that the coarse face lets in, material in flight or pressed
    beyond its voids in a corner. Where a skeleton is pressed to near its grains, stress is as steep as 1 / J and single
    points overshoot the shock, 2.7 times so far.
    """
    names = {"pressure_noise", "stress_ratio"}
    names |= {"pushed_share", "gaps_bounded_share", "voids_closed_share"}
    if scenario.numerics.transfer == "flip":
        # Points keep velocities that the grid does not see and that move nothing: scenarios/hard/flip_soft.json.
        names.add("speed_ratio")
    return names


QUIET = [HealthCheck.too_slow, HealthCheck.data_too_large]


@pytest.mark.slow
@settings(max_examples=300, deadline=None, suppress_health_check=QUIET)
@given(scenes(["two_phase", "undrained", "dry"], ["float64", "float32"], ["aflip", "apic", "flip"]))
def test_many_random_scenes(data):
    assert_stable(data)
