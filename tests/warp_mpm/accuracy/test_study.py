"""Studies of accuracy: what is planned, run and measured, and what a ladder of spacings tells."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analytic.scene import scene_of
from warp_mpm.accuracy import runner
from warp_mpm.accuracy.errors import extrapolate
from warp_mpm.accuracy.formulas import formulas
from warp_mpm.accuracy.keys import run_key, scene_key
from warp_mpm.accuracy.measure import judged_series, measure
from warp_mpm.accuracy.runner import StudyProgress, run_settings
from warp_mpm.accuracy.study import COMBINATIONS, DEFAULT, EVERYTHING, KNOBS, known_ladder, ladder, plan
from warp_mpm.engine import Ended, Processes
from warp_mpm.scenario import Scenario

SCENARIOS = Path(__file__).parents[3] / "scenarios"


class TestExtrapolation:
    @pytest.mark.parametrize("order", [0.7, 1.0, 1.8])
    def test_finds_limit_and_order_of_an_exact_law(self, order: float) -> None:
        spacings = [0.4, 0.3, 0.2, 0.15]
        reference = extrapolate(spacings, [5.0 + 2.0 * h**order for h in spacings])
        assert reference.order == pytest.approx(order, abs=0.01)  # tolerance of the bounded search
        assert reference.value == pytest.approx(5.0, abs=0.01)
        assert abs(reference.value - 5.0) <= reference.uncertainty

    def test_does_not_extrapolate_what_wobbles(self) -> None:
        reference = extrapolate([0.4, 0.3, 0.2, 0.15], [1.0, 1.2, 0.9, 1.1])
        assert reference.order is None
        assert reference.value == 1.1
        assert reference.uncertainty == pytest.approx(0.3)  # spread of the three finest: 0.9 to 1.2

    def test_order_amid_scatter_is_not_believed(self) -> None:
        # The best fit has order 0.83, but leaves most of what varies.
        reference = extrapolate([0.4, 0.3, 0.2, 0.15], [1.1, 1.2, 0.98, 1.06])
        assert reference.order is None
        assert reference.value == 1.06

    def test_uncertainty_covers_the_truth_in_nine_ladders_of_ten(self) -> None:
        random = np.random.default_rng(7)
        spacings = np.array([0.4, 0.3, 0.2, 0.15])
        covered = 0
        for _ in range(200):
            order, slope = random.uniform(0.6, 1.9), random.uniform(0.5, 2.0)
            values = 10.0 + slope * spacings**order + random.normal(0.0, 0.01, 4)
            reference = extrapolate(spacings, values)
            covered += abs(reference.value - 10.0) <= reference.uncertainty
        assert covered >= 180

    def test_needs_three(self) -> None:
        with pytest.raises(ValueError, match="three"):
            extrapolate([0.4, 0.2], [1.0, 2.0])


class TestPlan:
    def test_holds_every_knob_a_ladder_and_every_effect_once(self, scene: Scenario) -> None:
        settings = plan(scene, quick=True)
        assert {s.knob for s in settings if not s.physics and not s.refined} == {DEFAULT, *KNOBS}
        assert {s.knob for s in settings if s.physics} == {"undrained", "dry", "elastic", "fixed"}
        assert [s.spacing for s in settings if s.knob == DEFAULT] == [0.8, 0.6, 0.4, 0.3]
        for knob, level in COMBINATIONS:
            ladder_of_it = [s for s in settings if (s.knob, s.level) == (knob, level) and not s.refined]
            assert sorted(s.spacing for s in ladder_of_it) == [0.4, 0.6, 0.8]
        for settings_of_a_role in ([s for s in settings if s.refined], [s for s in settings if not s.refined]):
            assert len({s.key for s in settings_of_a_role}) == len(settings_of_a_role)

    @pytest.mark.parametrize(("quick", "at", "coarser"), [(True, 0.6, 0.8), (False, 0.3, 0.6)])
    def test_refines_what_a_ladder_shares_one_by_one_and_at_once(
        self, scene: Scenario, quick: bool, at: float, coarser: float
    ) -> None:
        settings = plan(scene, quick=quick)
        refined = [s for s in settings if s.refined]
        assert {(s.knob, s.level) for s in refined if s.spacing == at} == {
            ("courant_number", 0.475),
            ("transfer_damping", 0.1),
            ("pressure_relaxation", 0.1),
            ("bulk_viscosity", 0.1),
            ("density_correction", 0.5),
            ("points_per_cell", 9),
            ("record_interval", 0.005),
            (EVERYTHING, None),
        }
        assert [(s.knob, s.spacing) for s in refined if s.spacing != at] == [(EVERYTHING, coarser)]
        assert {at, coarser} <= {s.spacing for s in settings if s.knob == DEFAULT}
        whole = next(s.scenario for s in refined if s.knob == EVERYTHING)
        numerics, plain = whole.numerics, scene.numerics
        for name in ("courant_number", "transfer_damping", "pressure_relaxation", "bulk_viscosity"):
            assert getattr(numerics, name) == 0.5 * getattr(plain, name)
        assert (numerics.points_per_cell, whole.output.time_series_interval_s) == (9, 0.005)

    @pytest.mark.parametrize(
        ("changes", "there", "not_there"),
        [
            ({"numerics.transfer": "flip"}, {"pic_share"}, {"transfer_damping"}),
            ({"numerics.transfer": "apic"}, set(), {"pic_share", "transfer_damping"}),
            ({"numerics.bulk_viscosity": 0.0}, {"transfer_damping"}, {"bulk_viscosity"}),
            ({"numerics.points_per_cell": 16}, {"courant_number"}, {"points_per_cell"}),
            ({"numerics.volumetric_smoothing": False}, {"courant_number"}, {"density_correction"}),
        ],
    )
    def test_refines_only_what_the_scene_uses(
        self, scene: Scenario, changes: dict[str, Any], there: set[str], not_there: set[str]
    ) -> None:
        found = {s.knob for s in known_ladder(scene.replaced(changes), [0.8, 0.6, 0.4]) if s.refined}
        assert there <= found
        assert not not_there & found

    def test_full_study_holds_what_the_quick_one_says(self, scene: Scenario) -> None:
        quick, full = plan(scene, quick=True), plan(scene, quick=False)
        assert len(full) > len(quick)
        assert {s.key for s in quick if s.knob == DEFAULT} <= {s.key for s in full}

    def test_spacing_that_no_decimal_tells_stays_what_it_is(self, scene: Scenario) -> None:
        (setting,) = ladder(scene, [6.0 / 17.0])
        # A crest is on a grid line to a millionth of a spacing.
        assert 6.0 / setting.spacing == pytest.approx(17.0, abs=1e-9)
        assert setting.name == "spacing 0.3529"

    def test_dry_scene_turns_no_drag(self) -> None:
        settings = plan(Scenario.load(SCENARIOS / "case_1_dry.json"), quick=True)
        assert not {"drag", "dry", "undrained"} & {s.knob for s in settings}

    def test_scene_without_an_effect_is_the_paper_s(self, scene: Scenario) -> None:
        dry = next(s for s in plan(scene, quick=True) if s.knob == "dry").scenario
        own = Scenario.load(SCENARIOS / "case_1_dry.json")
        assert dry.flow == own.flow

    def test_key_tells_numbers_apart_and_nothing_else(self, scene: Scenario) -> None:
        assert run_key(scene) == run_key(scene.replaced({"title": "other"}))
        assert run_key(scene) != run_key(scene.replaced({"numerics.courant_number": 0.5}))
        assert scene_key(scene) == scene_key(scene.replaced({"numerics.spacing_m": 0.2}))
        assert scene_key(scene) != scene_key(scene.replaced({"output.end_time_s": 2.0}))


class TestMeasure:
    def test_denser_records_are_judged_like_others(self) -> None:
        """Forces as means over 10 ms, all else as it is at their ends; the last stretch may be shorter."""
        time = np.array([0.0, 0.005, 0.01, 0.015, 0.02, 0.022])
        series = {"time": time, "impact_force_x": np.array([0.0, 2.0, 4.0, 8.0, 0.0, 5.0]), "place": 10.0 * time}
        judged = judged_series(series)
        assert judged["time"].tolist() == [0.0, 0.01, 0.02, 0.022]
        assert judged["impact_force_x"] == pytest.approx([0.0, 3.0, 4.0, 5.0])
        assert judged["place"] == pytest.approx([0.0, 0.1, 0.2, 0.22])
        coarse = {"time": np.array([0.0, 0.01, 0.02]), "impact_force_x": np.array([0.0, 3.0, 4.0])}
        assert judged_series(coarse) is coarse


class TestFormulas:
    def test_closed_form_tells_times_from_the_start_of_the_run(self, scene: Scenario) -> None:
        """Case 1: 3 m at 10 m/s to the barrier; the closed form counts from the front's arrival."""
        paper = next(one for one in formulas(scene) if "paper" in one.name)
        impact = scene_of(scene).impact()
        assert paper.figures["peak_force_time"] == pytest.approx(0.3 + impact.peak_time)
        assert paper.figures["impact_duration"] == impact.duration
        assert 0.0 < paper.time < 0.01  # microseconds, whatever the machine

    def test_fixed_barrier_has_no_sliding(self) -> None:
        for one in formulas(Scenario.load(SCENARIOS / "case_1_fixed.json")):
            assert "barrier_displacement_final" not in one.figures


class Here(Processes):
    """No process, whose start takes longer than the run."""

    def run(self, tasks, *, on_start, **_):
        for task in tasks:
            on_start(task)
            yield Ended(task, task.function(*task.arguments))


class TestRunner:
    def test_runs_once_and_goes_on_where_it_stopped(
        self, scene: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        short = scene.replaced({"output.end_time_s": 0.05, "numerics.spacing_m": 0.8})
        settings = ladder(short, [1.0, 0.8])
        seen: list[StudyProgress] = []
        twice = [*settings, replace(settings[0], refined=True)]  # a choice that is also looked at for the reference
        first = run_settings(twice, tmp_path, jobs=1, on_progress=seen.append)
        assert (seen[-1].done, seen[-1].left) == (2, 0)
        assert all(p.done + len(p.running) + p.left == 2 for p in seen)
        (tmp_path / f"{settings[0].key}.json").unlink()
        (tmp_path / f"{settings[1].key}.json").write_text(json.dumps(first[settings[1].key] | {"steps": -1}))
        monkeypatch.setattr(runner, "Processes", Here)
        second = run_settings(settings, tmp_path, jobs=1)
        assert second[settings[1].key]["steps"] == -1  # read, not run
        assert second[settings[0].key]["figures"] == first[settings[0].key]["figures"]

    @pytest.mark.parametrize("damaged", ["{", '{"status": "finished"}'])
    def test_damaged_result_is_run_again(
        self, scene: Scenario, tmp_path: Path, damaged: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(runner, "Processes", Here)
        (setting,) = ladder(scene.replaced({"output.end_time_s": 0.02}), [1.0])
        (tmp_path / f"{setting.key}.json").write_text(damaged)
        assert run_settings([setting], tmp_path, jobs=1)[setting.key]["figures"]

    def test_measure_tells_figures_curves_and_times(self, scene: Scenario) -> None:
        (setting,) = ladder(scene.replaced({"output.end_time_s": 0.5}), [0.8])
        result = measure(setting.scenario, profile=True)
        assert result["status"] == "finished"
        assert (
            result["figures"]["barrier_displacement_final"] == result["curves"]["barrier_displacement"][-1]
            or abs(result["figures"]["barrier_displacement_final"] - result["curves"]["barrier_displacement"][-1])
            < 1e-6 * result["figures"]["barrier_displacement_final"]
        )
        assert sum(result["kernel_times"].values()) == pytest.approx(1.0)
        assert result["cpu_time"] > 0.0
        dense = measure(setting.scenario.replaced({"output.time_series_interval_s": 0.005}))
        assert dense["curves"]["time"] == pytest.approx(result["curves"]["time"])
        assert dense["samples"] == 2 * result["samples"] - 1
        json.dumps(result)
