"""A time series that records less: what is left out is not computed, and what needed it is told as not known."""

import json

import numpy as np
import pytest

from warp_mpm.caveats import run_caveats
from warp_mpm.plotting import comparison, force_and_displacement
from warp_mpm.quantities import TIME_SERIES, quantities_of, recorded_quantities
from warp_mpm.results import Results, ResultsError
from warp_mpm.run import resume_run, run_scenario
from warp_mpm.scenario_errors import ScenarioError
from warp_mpm.simulation import Simulation
from warp_mpm.summary import not_recorded, summarize

OF_THE_LEDGER = {key for key, quantity in TIME_SERIES.items() if quantity.of_points}
COARSE = {"numerics.spacing_m": 0.75, "output.end_time_s": 0.6}
SCENES = {
    "case_1": {}, "case_1_dry": {}, "case_1_undrained": {}, "case_1_fixed": {}, "case_5": {},
    "set_i": {"barrier": None}, "set_iib": {"barrier.motion": {"kind": "prescribed", "times_s": [0],
    "velocities_m_per_s": [0.5]}}, "set_v": {"barrier": None, "ground": None},
}  # fmt: skip
OWN_KERNELS = ("set_i",)
"""That no other test needs."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in OWN_KERNELS)) for name in SCENES]
)
def test_the_quantities_of_a_scene_are_those_that_are_sampled(load_scene, name):
    scenario = load_scene(name, **COARSE | SCENES[name])
    sample = Simulation(scenario).sample()
    assert quantities_of(scenario) == [key for key in TIME_SERIES if key in sample]


def test_what_is_left_out_is_not_computed(load_scene):
    scenario = load_scene("case_1", **COARSE)
    whole, part = Simulation(scenario), Simulation(scenario)
    launched, stepping = [], part._stepping
    stepping.launch = lambda one, *rest, launch=stepping.launch: (launched.append(one.kernel), launch(one, *rest))[1]
    cheap = ["impact_force_x", "base_force", "barrier_displacement", "left_mass"]
    for time in (0.2, 0.4, 0.6):
        whole.advance(time)
        part.advance(time)
        everything = whole.sample()
        assert part.sample(cheap) == {name: everything[name] for name in ("time", *cheap)}
    assert "update" in launched
    assert "ledger" not in launched
    assert stepping.ledger_graph is None
    # One sum over the points calls for all of them, and is the same as among all.
    assert part.sample(["liquid_mass"])["liquid_mass"] == everything["liquid_mass"]
    assert "ledger" in launched


def test_every_quantity_of_the_ledger_is_named_as_such(load_scene):
    """Without the sums all others are what they are with them; those of the ledger are nil."""
    simulation = Simulation(load_scene("case_1", **COARSE))
    simulation.advance(0.3)
    others = set(quantities_of(simulation.scenario)) - OF_THE_LEDGER
    cheap = simulation.sample(others)
    twin = Simulation(simulation.scenario)
    twin.advance(0.3)
    everything = twin.sample()
    assert cheap == {name: everything[name] for name in everything if name in others}
    assert all(everything[name] != 0.0 for name in OF_THE_LEDGER)


def recorded(flying_points, scenario, out):
    """A run folder with the columns that a scenario asks for, and its summary."""

    class Sampled(flying_points):
        """What `Simulation.sample` does with names."""

        def sample(self, names=None, *, since=None):
            values = super().sample(since=since)
            return values if names is None else {name: values[name] for name in values if name in {"time", *names}}

    return run_scenario(scenario, out, make_simulation=Sampled).summary


def test_a_run_that_records_one_quantity(load_scene, tmp_path):
    scenario = load_scene("case_1", **COARSE | {"output.quantities": ["impact_force_x"]})
    outcome = run_scenario(scenario, tmp_path / "one", make_simulation=Simulation)
    results = Results.open(tmp_path / "one")
    assert set(results.time_series) == {"time", "impact_force_x"}
    complete = run_scenario(load_scene("case_1", **COARSE), tmp_path / "all", make_simulation=Simulation).summary
    assert outcome.summary["peak_force"] == complete["peak_force"] > 0.0
    unknown = outcome.summary["not_recorded"]
    assert unknown["barrier_at_rest"] == ["barrier_velocity"]
    assert unknown["mass_error"] == ["solid_mass", "liquid_mass", "left_mass"]
    assert all(outcome.summary[name] is None for name in unknown)
    assert "not_recorded" not in complete
    notes = run_caveats(results.record, outcome.summary)
    assert any("output.quantities leaves out barrier_displacement, barrier_velocity" in note for note in notes)
    assert len(force_and_displacement(results).axes) == 1


@pytest.mark.parametrize("name", ["case_1", "case_1_dry", "case_1_fixed"])
def test_no_figure_is_wrong_because_a_quantity_is_missing(load_scene, name):
    """Of a run's series each column is taken away by itself: a figure is then what it was, or told as not known."""
    scenario = load_scene(name, **COARSE)
    simulation, samples = Simulation(scenario), []
    for number in range(61):
        simulation.advance(0.01 * number)
        samples.append(simulation.sample())
    series = {TIME_SERIES[key].name: np.array([sample[key] for sample in samples]) for key in samples[0]}
    complete = summarize(scenario, series, None, {})
    for absent in set(series) - {"time"}:
        less = scenario.replaced({"output.quantities": [name for name in series if name != absent]})
        columns = {name: values for name, values in series.items() if name != absent}
        figures = summarize(less, columns, None, {})
        unknown = figures.pop("not_recorded", {})
        assert unknown == not_recorded(less)
        assert all(names == [absent] for names in unknown.values())
        for figure in complete:
            if complete[figure] is not None and figures[figure] != complete[figure]:
                assert figures[figure] is None
                assert figure.removesuffix("_time") in unknown or absent == "impact_force_x"


def test_an_interrupted_run_goes_on_with_the_same_columns(load_scene, tmp_path):
    changes = {"output.quantities": ["momentum_x", "time_step"], "output.checkpoint_interval_s": 0.1}
    scenario = load_scene("case_1_dry", **COARSE | changes)
    run_scenario(scenario, tmp_path / "whole", make_simulation=Simulation)
    asked = []
    run_scenario(
        scenario, tmp_path / "cut", make_simulation=Simulation, stop=lambda: asked.append(0) or len(asked) > 40
    )
    resume_run(tmp_path / "cut", make_simulation=Simulation)
    texts = [(tmp_path / folder / "timeseries.csv").read_text() for folder in ("whole", "cut")]
    assert texts[0].startswith("time [s],momentum_x [N s/m],time_step [s]\n")
    assert texts[0] == texts[1]


def test_nothing_but_time(flying_points, load_scene, tmp_path):
    scenario = load_scene("case_1", **COARSE | {"output.quantities": []})
    summary = recorded(flying_points, scenario, tmp_path / "run")
    assert set(Results.open(tmp_path / "run").time_series) == {"time"}
    assert summary["peak_force"] is None
    for figure in (force_and_displacement, lambda results: comparison([results])):
        with pytest.raises(ResultsError, match="does not record impact_force_x"):
            figure(Results.open(tmp_path / "run"))
    json.dumps(summary, allow_nan=False)


def test_names_that_are_none(load_scene):
    said = r'output.quantities: "force" cannot be chosen; each must be one of time.*barriers are recorded always'
    with pytest.raises(ScenarioError, match=said):
        load_scene("case_1", **{"output.quantities": ["force"]})
    with pytest.raises(ScenarioError, match="is there twice"):
        load_scene("case_1", **{"output.quantities": ["top_force", "top_force"]})
    with pytest.raises(ScenarioError, match="must be a list of texts"):
        load_scene("case_1", **{"output.quantities": "top_force"})
    # What the scene does not have is passed over, so that one list serves dry and wet scenes.
    dry = load_scene("case_1_dry", **{"output.quantities": ["liquid_mass", "top_force"]})
    assert recorded_quantities(dry) == ["time", "top_force_x"]
