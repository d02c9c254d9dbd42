"""How errors and prices are told, and what a spacing and settings owe to them, on runs that are made up."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from warp_mpm.accuracy.budget import Budget
from warp_mpm.accuracy.errors import errors, overall, references
from warp_mpm.accuracy.formulas import formulas
from warp_mpm.accuracy.pictures import error_against_cost, error_against_time
from warp_mpm.accuracy.study import COMBINATIONS, DEFAULT, KNOBS, Setting, known_ladder, ladder, plan
from warp_mpm.accuracy.tables import budget_table, csv_table, markdown
from warp_mpm.accuracy.verdict import Study, evaluate, front, sentences
from warp_mpm.scenario import Scenario


def made_up(scenario: Scenario, *, order: float = 1.0, wobble: float = 0.0, shared: float = 0.0) -> dict[str, Any]:
    """A result that follows a law: f = f0 (1 + 0.1 h^order), and time that falls with the cube of the spacing.

    Courant number and relaxation move it besides, at every spacing alike: by `shared` each, of 0.95 and of 0.2.
    """
    numerics = scenario.numerics
    off = 0.1 * numerics.spacing_m**order + wobble
    off += shared * (numerics.courant_number / 0.95 + numerics.pressure_relaxation / 0.2)
    if numerics.points_per_cell == 1:
        off += 0.2
    time = [0.0, 0.5, 1.0]
    cost = numerics.points_per_cell / 4.0 * 0.95 / numerics.courant_number / numerics.spacing_m**3
    return {
        "status": "finished",
        "problem": None,
        "cpu_time": cost,
        "recording_time": 0.0,
        "preparation_time": 0.1,
        "wall_time": cost,
        "steps": 10,
        "material_points": 20,
        "figures": {
            "peak_force": 4e5 * (1 + off),
            "impulse": 1e6 * (1 + off),
            "impact_duration": 2.0,
            "peak_force_time": 0.5,
            "barrier_displacement_final": 1.3 * (1 + off),
            "pore_pressure_max": 1e5 * (1 + off),
            "overtopped_volume": 4.0 * (1 + off),
        },
        "curves": {
            "time": time,
            "impact_force_x": [0.0, 4e5 * (1 + off), 1e5],
            "flow_kinetic_energy": [4e6, 2e6 * (1 + off), 1e5],
            "barrier_displacement": [0.0, 0.5 * (1 + off), 1.3 * (1 + off)],
        },
        "kernel_times": {"scatter": 0.6, "gather": 0.4},
    }


class TestVerdict:
    def test_errors_prices_and_front(self, scene: Scenario) -> None:
        settings = plan(scene, quick=True)
        study = evaluate(scene, settings, {s.key: made_up(s.scenario) for s in settings})
        ladder_rows = {row.setting.spacing: row for row in study.rows if row.setting.knob == DEFAULT}
        # The law's error at spacing h is 0.1 h; the search for the order ends within 0.01.
        assert ladder_rows[0.8].errors["peak_force"] == pytest.approx(0.08, abs=1e-3)
        assert study.references.scalars["peak_force"].value == pytest.approx(4e5, rel=1e-3)
        # An error of a volume is relative to the flow's, 45 m3/m; made up are 4 m3/m overtopped.
        assert ladder_rows[0.8].errors["overtopped_volume"] == pytest.approx(0.08 * 4.0 / 45.0, abs=1e-4)
        price = study.price("peak_force", 0.05)
        assert price is not None
        assert (price.setting.knob, price.setting.spacing) == (DEFAULT, 0.4)
        # 0.08, 0.06, 0.04, 0.03: 0.4 m is the coarsest below 5 %.
        assert study.recommended_spacing == 0.4
        assert study.default_beaten_by is None
        times = [row.time for row in study.fronts["overall"]]
        wrong = [row.overall for row in study.fronts["overall"]]
        assert times == sorted(times)
        assert wrong == sorted(wrong, reverse=True)
        one_point = next(k for k in study.knobs if (k.name, k.level) == ("points_per_cell", 1))
        assert one_point.verdict.startswith("less accurate")
        many = next(k for k in study.knobs if (k.name, k.level) == ("points_per_cell", 16))
        assert many.verdict == "buys nothing"

    def test_worst_key_figure_counts(self, scene: Scenario) -> None:
        settings = ladder(scene, [0.8, 0.6, 0.4, 0.3])
        known = references(scene, settings, {s.key: made_up(s.scenario) for s in settings})
        wrong = {"peak_force": 0.01, "impulse": -0.05, "barrier_displacement_final": 0.02, "pore_pressure_max": 0.9}
        assert overall(wrong, known) == 0.05
        del wrong["impulse"]
        assert math.isinf(overall(wrong, known))

    def test_error_that_cancels_once_buys_nothing(self, scene: Scenario) -> None:
        # Right on the coarsest grid by accident, 9 % off on the next, then within the 1 % of the finest three's spread.
        off = {1.6: 0.0, 0.8: 0.10, 0.6: 0.01, 0.4: 0.0, 0.3: 0.005}
        settings = ladder(scene, list(off))
        results = {s.key: made_up(s.scenario, order=0.0, wobble=off[s.spacing]) for s in settings}
        study = evaluate(scene, settings, results)
        assert front(study.rows, "peak_force")[0].setting.spacing == 1.6  # it is on the front all the same
        price = study.price("peak_force", 0.05)
        assert price is not None
        assert price.setting.spacing == 0.6

    def test_finer_runs_count_against_the_default_only_where_the_other_has_them_too(self, scene: Scenario) -> None:
        settings = plan(scene, quick=True)
        study = evaluate(scene, settings, {s.key: made_up(s.scenario) for s in settings})
        knob, level = COMBINATIONS[0]

        def with_error(other_at_own: float, default_at_own: float) -> Study:
            """The default stumbles at 0.3 m, where the other was not run; the other costs next to nothing."""
            rows = []
            for row in study.rows:
                if row.setting.knob == DEFAULT:
                    wrong, result = {0.4: default_at_own, 0.3: 0.2}.get(row.setting.spacing, 0.0), row.result
                elif (row.setting.knob, row.setting.level) == (knob, level):
                    wrong, result = {0.4: other_at_own}.get(row.setting.spacing, 0.0), {**row.result, "cpu_time": 1e-3}
                else:
                    wrong, result = 1.0, row.result
                rows.append(replace(row, overall=wrong, result=result))
            return replace(study, rows=rows)

        doubt = study.doubt("overall")
        assert with_error(0.1, 0.0).default_beaten_by is None
        beaten = with_error(0.1, 0.11 + doubt).default_beaten_by
        assert beaten is not None
        assert beaten.setting.knob == knob

    def test_nothing_is_sold_below_what_the_reference_is_known_to(self, scene: Scenario) -> None:
        settings = ladder(scene, [0.8, 0.6, 0.4, 0.3])
        study = evaluate(scene, settings, {s.key: made_up(s.scenario) for s in settings})
        # The finest is off by 3 %, and the limit beyond it known to 1.25 times that.
        finest = study.price("peak_force", 0.039)
        assert finest is not None
        assert finest.setting.spacing == 0.3
        assert study.price("peak_force", 0.035) is None

    def test_setting_without_a_ladder_is_not_sold(self, scene: Scenario) -> None:
        settings = plan(scene, quick=True)
        results = {s.key: made_up(s.scenario) for s in settings}
        single = next(s for s in settings if s.knob == "bulk_viscosity")
        lucky = made_up(single.scenario, wobble=-0.1 * single.spacing)  # no error at all, at one spacing
        results[single.key] = lucky | {"cpu_time": 1e-3}
        price = evaluate(scene, settings, results).price("peak_force", 0.05)
        assert price is not None
        assert price.setting.knob == DEFAULT

    def test_run_that_diverged_has_no_error_and_stops_nothing(self, scene: Scenario) -> None:
        settings = plan(scene, quick=True)
        results = {s.key: made_up(s.scenario) for s in settings}
        lost = next(s for s in settings if s.knob == "transfer")
        results[lost.key] |= {"status": "diverged", "problem": "it did", "figures": {}, "curves": {}}
        study = evaluate(scene, settings, results)
        row = next(row for row in study.rows if row.setting.key == lost.key)
        assert math.isinf(row.overall)
        assert row not in study.fronts["overall"]
        assert "diverged" in markdown(study, [])
        assert lost.name in csv_table(study)

    def test_reference_run_is_off_by_what_it_is_not_known_to(self, scene: Scenario) -> None:
        settings = ladder(scene, [0.8, 0.6, 0.4, 0.3])
        shift = {0.8: 0.0, 0.6: 0.1, 0.4: -0.1, 0.3: 0.05}
        results = {s.key: made_up(s.scenario, order=0.0, wobble=shift[s.spacing]) for s in settings}
        known = references(scene, settings, results)
        assert known.scalars["impulse"].order is None
        assert errors(results[settings[-1].key], known)["impulse"] == known.uncertainty("impulse") > 0.1

    def test_table_has_a_line_for_every_run(self, scene: Scenario) -> None:
        settings = plan(scene, quick=True)
        study = evaluate(scene, settings, {s.key: made_up(s.scenario) for s in settings})
        lines = csv_table(study).splitlines()
        assert len(lines) == 1 + sum(not s.physics for s in settings)
        assert sum("everything refined" in line for line in lines) == 2
        assert len({len(re.findall(r',(?=(?:[^"]*"[^"]*")*[^"]*$)', line)) for line in lines}) == 1


@pytest.fixture(scope="module")
def settings(scene: Scenario) -> list[Setting]:
    return plan(scene, quick=True)


@pytest.fixture(scope="module")
def study(scene: Scenario, settings: list[Setting]) -> Study:
    """Of a scene in which Courant number and relaxation move everything by 2 % each, at every spacing alike."""
    return evaluate(scene, settings, {s.key: made_up(s.scenario, shared=0.02) for s in settings})


class TestBudget:
    def test_ladder_cannot_see_what_its_runs_share_and_the_budget_does(
        self, scene: Scenario, settings: list[Setting], study: Study
    ) -> None:
        results = {s.key: made_up(s.scenario, shared=0.02) for s in settings}
        alone = references(scene, [s for s in settings if s.knob == DEFAULT], results)
        truth = 4e5  # where spacing, time step and relaxation go to nought
        off = abs(alone.scalars["peak_force"].value - truth) / truth
        assert off == pytest.approx(0.04, abs=2e-3)
        assert alone.uncertainty("peak_force") == pytest.approx(alone.budget.spacing["peak_force"])
        known = study.references.budget
        # Half of 2 % each, relative to a reference that is 4 % too high.
        part = 0.01 / 1.04
        for setting in ("courant_number", "pressure_relaxation"):
            assert known.settings[setting]["peak_force"] == pytest.approx(-part, rel=1e-2)
        assert known.settings["bulk_viscosity"]["peak_force"] == pytest.approx(0.0, abs=1e-12)
        # Both at once: twice one of them, more than the root of the squares. And what does not fall with the spacing
        # goes on as it began, when the settings go on to nought.
        assert known.change("peak_force") == pytest.approx(2.0 * part, rel=1e-2)
        assert known.stays("peak_force")
        assert known.shared("peak_force") == pytest.approx(4.0 * part, rel=1e-2) == pytest.approx(off / 1.04, rel=0.05)
        assert study.doubt("peak_force") == pytest.approx(math.hypot(known.spacing["peak_force"], 4.0 * part), rel=1e-2)

    def test_parts_are_joined_as_squares_where_they_do_not_add_up(self) -> None:
        parts = {"courant_number": {"impulse": 0.03}, "bulk_viscosity": {"impulse": -0.04}}
        budget = Budget({"impulse": 0.12}, parts, {0.2: {"impulse": -0.01}, 0.4: {"impulse": 0.5}}, 0.2)
        assert budget.shared("impulse") == pytest.approx(0.05)
        assert budget.total("impulse") == pytest.approx(0.13)
        assert budget.greatest("impulse") == "spacing"
        assert replace(budget, spacing={"impulse": 0.01}).greatest("impulse") == "bulk viscosity"

    @pytest.mark.parametrize(
        ("fine", "coarse", "counted"),
        [
            *((0.06, 0.12, 0.06), (0.06, -0.06, 0.06), (0.06, 0.02, 0.06), (0.06, 0.0, 0.06), (0.01, 0.04, 0.05)),
            *((0.06, 0.08, 0.12), (-0.06, -0.08, 0.12), (0.06, 0.05, 0.12), (0.02, 0.02, 0.1)),
        ],
    )
    def test_effect_that_is_the_same_at_both_spacings_counts_twice(
        self, fine: float, coarse: float, counted: float
    ) -> None:
        """It falls where twice the spacing has 1.41 times of it or more; what changes sign, or grows so, is scatter."""
        parts = {"courant_number": {"impulse": 0.03}, "bulk_viscosity": {"impulse": -0.04}}
        budget = Budget({"impulse": 0.0}, parts, {0.2: {"impulse": fine}, 0.4: {"impulse": coarse}}, 0.2)
        assert budget.shared("impulse") == pytest.approx(counted)
        assert not replace(budget, together={0.2: {"impulse": fine}}).stays("impulse")

    def test_settings_that_only_together_are_off_are_told_so(self) -> None:
        budget = Budget({"impulse": 0.005}, {"courant_number": {"impulse": 0.01}}, {0.2: {"impulse": 0.05}}, 0.2)
        assert budget.greatest("impulse") == "all settings at once"
        assert replace(budget, together={}).greatest("impulse") == "time step"

    def test_nothing_is_sold_finer_than_settings_let_it_be_known(self, scene: Scenario) -> None:
        settings = plan(scene, quick=False)
        fine = evaluate(scene, settings, {s.key: made_up(s.scenario, order=1.5, shared=0.01) for s in settings})
        assert fine.references.budget.spacing["impulse"] < 0.005  # 1.25 times 0.1 times 0.1^1.5, were it only that
        assert fine.references.budget.shared("impulse") == pytest.approx(0.02, rel=0.03)
        assert fine.price("impulse", 0.015) is None
        assert fine.price("impulse", 0.03) is not None
        said = " ".join(sentences(fine))
        assert "whose effect is the same at two spacings and so counts twice" in said

    def test_table_tells_every_part(self, study: Study) -> None:
        text = "\n".join(budget_table(study))
        causes = ("spacing", "time step", "rate β of the transfer", "pressure relaxation", "bulk viscosity")
        for cause in (*causes, "density correction", "points per cell", "record interval", "**known to**"):
            assert text.count(f"\n| {cause} |") == 1
        assert text.count("\n| all settings at once | the same, at ") == 2
        assert "| time step | 0.475 | -0.96% | -0.96% |" in text
        assert f"**± {study.doubt('peak_force'):.2%}**" in text
        assert text in markdown(study, [])

    def test_setting_whose_refined_run_diverged_is_told(self, scene: Scenario, settings: list[Setting]) -> None:
        results = {s.key: made_up(s.scenario, shared=0.02) for s in settings}
        lost = next(s for s in settings if s.refined and s.knob == "bulk_viscosity")
        results[lost.key] |= {"status": "diverged", "problem": "it did", "figures": {}, "curves": {}}
        study = evaluate(scene, settings, results)
        assert "bulk viscosity refined the run diverged" in " ".join(sentences(study))
        assert "Diverged when refined, so not in the table: bulk_viscosity" in markdown(study, [])

    def test_ladder_alone_says_that_its_uncertainty_is_the_spacing_s(self, scene: Scenario) -> None:
        settings = ladder(scene, [0.8, 0.6, 0.4, 0.3])
        study = evaluate(scene, settings, {s.key: made_up(s.scenario) for s in settings})
        assert "the uncertainty is the spacing's alone" in " ".join(sentences(study))

    def test_greatest_pore_pressure_is_told_not_to_converge(self, study: Study) -> None:
        assert study.price("pore_pressure_max", 0.1) is None
        assert not [said for said in sentences(study) if "pore pressure" in said]
        line = next(line for line in markdown(study, []).splitlines() if "(does not converge)" in line)
        assert [cell.strip() for cell in line.split("|")[3:9]] == ["–", line.split("|")[4].strip(), *["–"] * 4]


class TestSlopes:
    def test_order_of_the_error_and_its_cost(self, scene: Scenario) -> None:
        """Time goes with the cube of the spacing."""
        for order in (0.8, 1.5):
            settings = ladder(scene, [0.8, 0.4, 0.2, 0.1, 0.05])
            study = evaluate(scene, settings, {s.key: made_up(s.scenario, order=order) for s in settings})
            slope = study.slopes["peak_force"]
            assert slope.spacing == pytest.approx(order, rel=0.05)
            assert slope.cost == pytest.approx(order / 3.0, rel=0.05)
            assert str(slope) == f"error ~ cost^-{slope.cost:.2g}, ~ spacing^{slope.spacing:.2g}"

    def test_errors_within_the_doubt_show_no_order(self, scene: Scenario) -> None:
        settings = ladder(scene, [0.8, 0.6, 0.4, 0.3])
        shift = {0.8: 0.0, 0.6: 0.1, 0.4: -0.1, 0.3: 0.05}
        results = {s.key: made_up(s.scenario, order=0.0, wobble=shift[s.spacing]) for s in settings}
        slope = evaluate(scene, settings, results).slopes["impulse"]
        assert (slope.cost, slope.spacing) == (None, None)
        assert str(slope) == "no order seen"

    def test_order_of_the_spacing_is_seen_though_the_settings_hide_the_truth(self, scene: Scenario) -> None:
        settings = known_ladder(scene, [0.8, 0.4, 0.2, 0.1, 0.05])
        study = evaluate(scene, settings, {s.key: made_up(s.scenario, order=1.2, shared=0.05) for s in settings})
        assert study.doubt("impulse") > 0.08 > max(row.errors["impulse"] for row in study.rows)
        assert study.slopes["impulse"].spacing == pytest.approx(1.2, rel=0.05)

    def test_errors_that_jump_show_no_order(self, scene: Scenario) -> None:
        spacings = [0.8, 0.6, 0.4, 0.3, 0.1, 0.05]
        shift = dict(zip(spacings, (0.9, 0.1, 0.5, 0.01, 0.0, 0.0), strict=True))
        settings = ladder(scene, spacings)
        results = {s.key: made_up(s.scenario, order=0.0, wobble=shift[s.spacing]) for s in settings}
        study = evaluate(scene, settings, results)
        assert sum(row.errors["impulse"] > study.doubt("impulse") for row in study.rows) >= 3
        assert study.slopes["impulse"].spacing is None

    def test_what_lies_below_the_doubt_bends_nothing(self, scene: Scenario) -> None:
        off = {1.6: 0.8, 0.8: 0.4, 0.4: 0.2, 0.2: 0.001, 0.1: 0.0, 0.05: 0.02}
        settings = ladder(scene, list(off))
        results = {s.key: made_up(s.scenario, order=0.0, wobble=off[s.spacing]) for s in settings}
        study = evaluate(scene, settings, results)
        rows = [row for row in study.rows if row.setting.spacing in (1.6, 0.8, 0.4)]
        assert all(abs(row.errors["impulse"]) > study.doubt("impulse") for row in rows)
        assert any(abs(row.errors["impulse"]) < study.doubt("impulse") for row in study.rows)
        spacings, wrong = np.log([[row.setting.spacing, row.errors["impulse"]] for row in rows]).T
        assert study.slopes["impulse"].spacing == pytest.approx(np.polyfit(spacings, wrong, 1)[0])


class TestPictures:
    def test_panels_tell_how_the_error_falls_and_where_the_floor_is(self, scene: Scenario) -> None:
        settings = known_ladder(scene, [0.8, 0.4, 0.2, 0.1])
        study = evaluate(scene, settings, {s.key: made_up(s.scenario, order=1.5, shared=0.001) for s in settings})
        figure = error_against_cost([study, study, study])
        drawn_panels = [panel for panel in figure.axes if panel.axison]
        assert len(drawn_panels) == 3
        for panel in drawn_panels:
            assert str(study.slopes["overall"]) in panel.get_title()
            assert "cost^-" in panel.get_title()
            assert "slope along the spacings" in panel.get_legend_handles_labels()[1]
            floors = [floor.get_y() + floor.get_height() for floor in panel.patches]
            assert floors == pytest.approx([study.doubt("overall"), study.spacing_doubt("overall")])
        in_time = error_against_time(study, [])
        titles = [panel.get_title() for panel in in_time.axes if panel.axison]
        assert all("cost^-" in title for title in titles[:3])
        for panel in in_time.axes[:3]:
            (line,) = [line for line in panel.lines if line.get_label() == "slope along the spacings"]
            time, error = np.log(line.get_xdata()), np.log(line.get_ydata())
            assert -np.polyfit(time, error, 1)[0] == pytest.approx(study.slopes["peak_force"].cost, rel=0.05)

    @pytest.mark.slow  # the full study's picture, for labels that touch
    def test_settings_and_spacings_are_told_apart(self, scene: Scenario) -> None:
        settings = plan(scene, quick=False)
        random = np.random.default_rng(3)
        results = {s.key: made_up(s.scenario, wobble=random.normal(0.0, 0.005)) for s in settings}
        figure = error_against_time(evaluate(scene, settings, results), formulas(scene))
        panel = figure.axes[0]
        knobs = {"spacing alone [m]", *(name.replace("_", " ") for name in KNOBS)}
        marks = [line.get_marker() for line in panel.lines if line.get_label() in knobs]
        assert len(marks) == len(set(marks)) == len(knobs)
        FigureCanvasAgg(figure).draw()
        for panel in figure.axes:
            labels = [text.get_window_extent() for text in panel.texts if text.get_visible()]
            assert all(not one.overlaps(other) for one, other in combinations(labels, 2))
            assert all(panel.bbox.contains(*corner) for one in labels for corner in (one.min, one.max))
        assert {text.get_text() for text in figure.axes[0].texts if text.get_visible()} >= {"0.4", "0.3", "0.1"}
