"""Buying accuracy on a made-up machine whose clock runs as it is told: what is probed, kept, asked and promised."""

from __future__ import annotations

import json
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from warp_mpm.accuracy import kept as keeping
from warp_mpm.accuracy import offer as offering
from warp_mpm.accuracy import purchase
from warp_mpm.accuracy.kept import Kept, cache_folder
from warp_mpm.accuracy.keys import scene_key
from warp_mpm.accuracy.offer import Offer, PurchaseError, Rung
from warp_mpm.accuracy.pace import LONG_ENOUGH, points_of
from warp_mpm.accuracy.purchase import buy
from warp_mpm.accuracy.shipped import Known
from warp_mpm.accuracy.study import refined_everything
from warp_mpm.cli import app
from warp_mpm.scenario import Scenario
from warp_mpm.time_step import step_limits

SCENARIOS = Path(__file__).parents[2] / "scenarios"


class MadeUp:
    """A machine that takes a fixed time for a step and for each point in it, and never an odd moment more."""

    least_cost, around = 1e-8, 2.7

    def __init__(
        self, *, speed: float = 1.0, compiling: float = 0.0, fails: tuple[float, ...] = (), shared: float = 0.0
    ):
        self.now, self.compiling, self.shared = 100.0, compiling, shared
        self.ran: list[float] = []
        """Spacings of whole runs [m]."""
        self.refined: list[float] = []
        """Those of whole runs with more points to a cell [m]."""
        self.step, self.point = 4e-5 / speed, 1.2e-7 / speed
        self._fails = fails

    def clock(self) -> float:
        return self.now

    def prepare(self, scenario: Scenario) -> float:
        self.now += self.compiling
        return self.compiling

    def steps(self, scenario: Scenario) -> int:
        """Steps of a run, each no longer than the flow's waves allow, that land on every record."""
        output, numerics = scenario.output, scenario.numerics
        interval = min(output.time_series_interval_s, output.snapshot_interval_s)
        largest = numerics.courant_number * numerics.spacing_m / (step_limits(scenario).wave_speed + 12.0)
        return math.ceil(output.end_time_s / interval - 1e-9) * math.ceil(interval / largest - 1e-9)

    def stepping(self, scenario: Scenario) -> float:
        return self.steps(scenario) * (self.step + self.point * points_of(scenario))

    def measure(self, scenario: Scenario, limit: float) -> dict[str, Any]:
        spacing, end, time = scenario.numerics.spacing_m, scenario.output.end_time_s, self.stepping(scenario)
        status = "finished" if time <= limit else "given up"
        done, setup = min(1.0, limit / time), 1e-5 * points_of(scenario)
        if any(math.isclose(spacing, failing, rel_tol=0.05) for failing in self._fails):
            status = "diverged"
        (self.refined if scenario.numerics.points_per_cell > 4 else self.ran).append(spacing)
        self.now += time * done + setup
        off = 0.1 * spacing + self.shared * scenario.numerics.courant_number / 0.95
        return {
            "status": status,
            "problem": None if status == "finished" else f"{status}: a stress is not finite",
            "cpu_time": time * done,
            "recording_time": 0.0,
            "preparation_time": setup,
            "end_time": done * end,
            "steps": math.ceil(self.steps(scenario) * done),
            "samples": 100,
            "paces": [[end * k / 10, 12.0, time / self.steps(scenario)] for k in range(10)],
            "figures": {"peak_force": 4e5 * (1 + off), "impulse": 1e6 * (1 + off)} if status == "finished" else {},
        }

    def step_cost(self, scenario: Scenario, seconds: float) -> tuple[float, float]:
        self.now += seconds
        return self.stepping(scenario) / self.steps(scenario), 0.5 * scenario.output.end_time_s


@pytest.fixture
def dry() -> Scenario:
    """Case 1, dry: nobody has measured it beforehand, and its coarse steps are as long as the records allow."""
    changes = {"flow.velocity_m_per_s": [9.0, 0.0], "output.end_time_s": 3.0}
    return Scenario.load(SCENARIOS / "case_1_dry.json").replaced(changes)


@pytest.fixture
def wet() -> Scenario:
    return Scenario.load(SCENARIOS / "case_1.json").replaced({"flow.velocity_m_per_s": [9.3, 0.0]})


def with_spacing(scenario: Scenario, offer: Offer) -> Scenario:
    return scenario.replaced({"numerics.spacing_m": offer.spacing})


SHORT = {("wet", 0.5): 6.0}
"""Budgets [s] up to which a scene cannot even be probed, by its name and the machine's speed."""


class TestTime:
    @pytest.mark.parametrize("budget", [6.0, 8.0, 20.0, 120.0, 3600.0])
    @pytest.mark.parametrize("speed", [0.5, 1.0, 3.0])
    @pytest.mark.parametrize("name", ["dry", "wet"])
    def test_probing_and_the_run_fit_into_the_budget_and_fill_it(
        self, name: str, budget: float, speed: float, request: pytest.FixtureRequest
    ) -> None:
        scenario, bench = request.getfixturevalue(name), MadeUp(speed=speed)
        begun = bench.now
        if budget <= SHORT.get((name, speed), 0.0):
            with pytest.raises(PurchaseError, match="is too short for this scene"):
                buy(scenario, budget=budget, bench=bench)
            assert bench.now - begun <= budget
            return
        offer = buy(scenario, budget=budget, bench=bench)
        assert bench.now - begun == pytest.approx(offer.probing)
        took = bench.now - begun + bench.stepping(with_spacing(scenario, offer)) + MadeUp.around
        assert took <= 1.1 * budget
        if offer.spacing > scenario.flow.depth / 100.0:
            assert took >= 0.55 * budget

    def test_steps_that_records_cut_short_tell_nothing_of_finer_ones(self, dry: Scenario) -> None:
        """With records that are as dense as the coarse steps, five times finer is more than five times the steps."""
        records = {"output.time_series_interval_s": 0.01, "output.snapshot_interval_s": 0.5}
        soft = dry.replaced(records | {"flow.material.young_modulus_Pa": 2e5})
        bench = MadeUp()
        offer = buy(soft, budget=60.0, bench=bench)
        coarse, fine = soft.replaced({"numerics.spacing_m": max(bench.ran)}), with_spacing(soft, offer)
        assert bench.steps(coarse) <= 2 * 300
        assert max(bench.ran) / offer.spacing > 4.0
        assert offer.time == pytest.approx(bench.stepping(fine) + MadeUp.around, rel=0.15)

    def test_what_is_too_short_to_be_timed_is_timed_finer(self, dry: Scenario) -> None:
        bench = MadeUp(speed=50.0)
        begun = bench.now
        buy(dry, accuracy=0.1, bench=bench)
        stepped = sum(bench.stepping(dry.replaced({"numerics.spacing_m": spacing})) for spacing in bench.ran)
        (spacing,) = bench.refined
        stepped += bench.stepping(refined_everything(dry, spacing).scenario)
        assert bench.now - begun - stepped >= 0.9 * LONG_ENOUGH

    def test_compiling_is_told_and_not_counted(self, dry: Scenario) -> None:
        offer = buy(dry, budget=20.0, bench=MadeUp())
        compiled = buy(dry, budget=20.0, bench=MadeUp(compiling=9.0))
        assert (compiled.spacing, compiled.probing) == (offer.spacing, pytest.approx(offer.probing))
        assert "Compiling the kernels took 9 s, once, and is not counted" in compiled.described()
        assert "Compiling" not in offer.described()

    def test_says_that_probing_counts(self, dry: Scenario) -> None:
        offer = buy(dry, budget=20.0, bench=MadeUp())
        assert f"with the {offer.probing:.2g} s of probing {offer.time + offer.probing:.3g} s in all" in (
            offer.described()
        )


@pytest.fixture
def shipped(monkeypatch: pytest.MonkeyPatch) -> Scenario:
    """A scene that was measured before, and what of it, where the program looks for that."""
    scene = Scenario.load(SCENARIOS / "case_1.json")
    rungs = [Rung(h, 0.1 / h**3, {"peak_force": 4e5 * (1 + 0.1 * h), "impulse": 1e6}) for h in (0.5, 0.4, 0.3, 0.2)]
    known = {scene_key(scene): Known(rungs, {"peak_force": 0.03, "impulse": 0.002})}
    monkeypatch.setattr(purchase, "shipped_scenes", lambda: known)
    return scene


class TestShared:
    """What the settings do that all probes share is looked at, and no spacing takes it away."""

    def test_is_probed_and_counts_in_what_is_promised(self, dry: Scenario) -> None:
        plain = buy(dry, budget=20.0, bench=MadeUp())
        offer = buy(dry, budget=20.0, bench=MadeUp(shared=0.04))
        assert plain.spacing == offer.spacing
        # Of 4 % half is left at half the Courant number, beside the 5 % of half a metre.
        change = 0.02 / 1.09
        for name, error in plain.errors.items():
            assert offer.errors[name] == pytest.approx(math.hypot(error, change), rel=0.02)

    def test_finer_accuracy_is_refused_with_the_reason(self, dry: Scenario) -> None:
        with pytest.raises(PurchaseError, match=r"changes by 1\.8% when the time step, the filters and the points are"):
            buy(dry, accuracy=0.01, bench=MadeUp(shared=0.04))
        assert buy(dry, accuracy=0.01, bench=MadeUp(), agree=lambda what: True).error <= 0.01

    def test_of_a_shipped_scene_it_is_shipped(self, shipped: Scenario) -> None:
        bench = MadeUp()
        offer = buy(shipped, budget=60.0, bench=bench)
        assert bench.refined == []
        assert offer.errors["peak_force"] > 0.03
        with pytest.raises(PurchaseError, match="which no spacing takes away"):
            buy(shipped, accuracy=0.03, bench=bench)

    def test_refined_probe_that_fails(self, dry: Scenario) -> None:
        class Delicate(MadeUp):
            def measure(self, scenario: Scenario, limit: float) -> dict[str, Any]:
                result = super().measure(scenario, limit)
                return result | ({"status": "diverged", "problem": "it did"} if self.refined else {})

        with pytest.raises(PurchaseError, match=r"The probe at 0\.5 m with all settings refined failed: it did"):
            buy(dry, accuracy=0.1, bench=Delicate())


class TestSettled:
    @pytest.mark.parametrize(("force", "warned"), [(4.0e5, False), (4.3e5, False), (4.5e5, True)])
    def test_says_where_the_run_is_not_what_was_expected(
        self, force: float, warned: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        figures = {"peak_force": force, "impulse": 1e6, "wall_time": 3.0}
        monkeypatch.setattr(offering, "figures_of", lambda run: figures)
        errors, values = {"peak_force": 0.05, "impulse": 0.01}, {"peak_force": 4e5, "impulse": 1e6}
        text = Offer(0.2, 5.0, 2.0, errors, values, "a probe", probing=1.0).settled(Path(), 6.5)
        assert "6.5 s of the processor and with probing 7.5 s in all, 1.2 times what was expected" in text
        assert ("more than twice what was expected of peak force" in text) == warned


class TestBudgetThatIsShort:
    def test_refuses_before_anything_is_run(self, dry: Scenario) -> None:
        bench = MadeUp()
        with pytest.raises(PurchaseError, match=r"--budget 2s is too short for any scene: to start and to finish"):
            buy(dry, budget=2.0, bench=bench)
        huge = dry.replaced({"flow.material.young_modulus_Pa": 1e12, "output.end_time_s": 100.0})
        with pytest.raises(PurchaseError, match=r"--budget 8s is too short for this scene: .* at least"):
            buy(huge, budget=8.0, bench=bench)
        assert bench.ran == []
        assert bench.now == 100.0

    def test_gives_a_probe_up_that_would_take_the_whole_budget(self, wet: Scenario) -> None:
        bench = MadeUp(speed=0.2)
        kept = Kept(None)
        with pytest.raises(PurchaseError, match=r"the coarsest probe, takes about \d"):
            buy(wet, budget=4.0, bench=bench, kept=kept)
        assert bench.now - 100.0 < 4.0
        assert not kept.content().get("probes")  # half a run is none

    def test_fewer_and_coarser_probes(self, wet: Scenario) -> None:
        numbers = {}
        for budget in (8.0, 14.0, 60.0):
            bench = MadeUp()
            buy(wet, budget=budget, bench=bench)
            numbers[budget] = sorted(round(wet.flow.depth / spacing) for spacing in bench.ran)
            assert bench.refined == [max(bench.ran)]
        assert numbers == {8.0: [4, 6, 8], 14.0: [6, 8, 11], 60.0: [6, 8, 11, 15]}

    def test_probes_that_leave_no_time_are_kept(self, dry: Scenario, tmp_path: Path) -> None:
        """And the sentence says that only where it is so."""
        for kept, again in ((Kept(tmp_path / "kept.json"), True), (Kept(None), False)):
            with pytest.raises(PurchaseError) as error:
                buy(dry, budget=MadeUp.around + 0.45, bench=MadeUp(speed=1.6), kept=kept)
            assert ("the probes are kept, and the same command has time enough now" in str(error.value)) == again
        offer = buy(dry, budget=MadeUp.around + 0.45, bench=MadeUp(speed=1.6), kept=kept)
        assert offer.spacing > 0.0


class TestKept:
    def test_same_choice_twice_without_a_probe(self, dry: Scenario, tmp_path: Path) -> None:
        first = buy(dry, budget=8.0, bench=MadeUp(), kept=Kept.of(dry, "cpu", tmp_path))
        another = MadeUp(speed=0.6)  # others are at work on the machine now
        again = buy(dry, budget=8.0, bench=another, kept=Kept.of(dry, "cpu", tmp_path))
        assert (again.spacing, again.errors, again.values) == (first.spacing, first.errors, first.values)
        assert another.ran == []
        assert again.probing == again.compiling == 0.0

    def test_other_questions_use_the_same_probes(self, dry: Scenario, tmp_path: Path) -> None:
        buy(dry, accuracy=0.1, bench=MadeUp(), kept=Kept.of(dry, "cpu", tmp_path))
        another = MadeUp()
        offer = buy(dry, budget=30.0, bench=another, kept=Kept.of(dry, "cpu", tmp_path))
        assert another.ran == []
        assert offer.time == pytest.approx(30.0, rel=0.1)

    def test_shipped_scene_is_timed_once(self, shipped: Scenario, tmp_path: Path) -> None:
        bench = MadeUp()
        first = buy(shipped, budget=30.0, bench=bench, kept=Kept.of(shipped, "cpu", tmp_path))
        second = buy(shipped, budget=40.0, bench=bench, kept=Kept.of(shipped, "cpu", tmp_path))
        assert len(bench.ran) == 1
        assert second.spacing < first.spacing
        assert "shipped" in first.source

    @pytest.mark.parametrize(
        "damaged",
        [
            "",
            "{",
            "[]",
            "null",
            '{"probes": []}',
            '{"probes": {"0.5": {}}}',
            '{"choices": {"--budget 8s": null}}',
            '{"choices": {"--budget 8s": {"spacing": 0.1}}}',
            '{"choices": {"--budget 8s": {"spacing": -1, "time": 3, "errors": {"impulse": 0.1}, "values": {}, '
            '"source": ""}}}',
            '{"choices": {"--budget 8s": {"spacing": NaN, "time": 3, "errors": {"impulse": 0.1}, "values": {}, '
            '"source": ""}}}',
            '{"timed": {"0.1": [0, 0]}}',
            "[" * 100_000,
            "\udcff",
        ],
    )
    def test_damaged_file_is_an_empty_one(self, dry: Scenario, tmp_path: Path, damaged: str) -> None:
        file = tmp_path / "kept.json"
        file.write_bytes(damaged.encode("utf-8", "surrogateescape"))
        expected = buy(dry, budget=8.0, bench=MadeUp())
        assert buy(dry, budget=8.0, bench=MadeUp(), kept=Kept(file)) == expected
        assert json.loads(file.read_text())["choices"]["--budget 8s"]["spacing"] == expected.spacing

    @pytest.mark.parametrize("cut", [0.1, 0.5, 0.99])
    def test_file_that_was_cut(self, dry: Scenario, tmp_path: Path, cut: float) -> None:
        file = tmp_path / "kept.json"
        expected = buy(dry, budget=8.0, bench=MadeUp(), kept=Kept(file))
        file.write_text(file.read_text()[: int(cut * file.stat().st_size)])
        assert buy(dry, budget=8.0, bench=MadeUp(), kept=Kept(file)) == expected

    @pytest.mark.parametrize("field", ["cpu_time", "paces", "figures", "status", "steps"])
    @pytest.mark.parametrize("value", [None, "three", [], {}, [[1.0]], math.inf, -1.0])
    def test_probe_that_is_no_probe(self, dry: Scenario, tmp_path: Path, field: str, value: Any) -> None:
        file = tmp_path / "kept.json"
        expected = buy(dry, accuracy=0.1, bench=MadeUp(), kept=Kept(file))
        content = json.loads(file.read_text())
        del content["choices"]
        next(iter(content["probes"].values()))[field] = value
        file.write_text(json.dumps(content))
        assert buy(dry, accuracy=0.1, bench=MadeUp(), kept=Kept(file)).spacing == expected.spacing

    def test_folder_that_cannot_be_written(self, dry: Scenario, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("no folder")
        kept = Kept(tmp_path / "file" / "kept.json")
        assert buy(dry, budget=8.0, bench=MadeUp(), kept=kept) == buy(dry, budget=8.0, bench=MadeUp())
        assert not kept.lasting

    def test_no_home(self, dry: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
        def homeless() -> Path:
            raise RuntimeError("Could not determine home directory.")

        monkeypatch.setattr(keeping, "cache_folder", homeless)
        assert buy(dry, budget=8.0, bench=MadeUp(), kept=Kept.of(dry, "cpu")).spacing > 0.0

    def test_two_at_once_choose_the_same(self, dry: Scenario, tmp_path: Path) -> None:
        """The second one ends its probes while the first one still runs its last."""
        file, found = tmp_path / "kept.json", []

        class Slow(MadeUp):
            def measure(self, scenario: Scenario, limit: float) -> dict[str, Any]:
                if len(self.ran) == 2:
                    found.append(buy(dry, budget=8.0, bench=MadeUp(speed=1.3), kept=Kept(file)))
                return super().measure(scenario, limit)

        assert buy(dry, budget=8.0, bench=Slow(), kept=Kept(file)).spacing == found[0].spacing
        assert buy(dry, budget=8.0, bench=MadeUp(), kept=Kept(file)).spacing == found[0].spacing

    def test_file_is_whole_whoever_writes(self, tmp_path: Path) -> None:
        file = tmp_path / "kept.json"

        def write(number: int) -> bool:
            for count in range(20):
                Kept(file).add({"timed": {f"{number}.{count}": [number + 1.0, 1.0]}})
            return bool(Kept(file).content())

        with ThreadPoolExecutor(4) as pool:
            assert all(pool.map(write, range(4)))
        assert len(json.loads(file.read_text())["timed"]) >= 20
        assert [path.name for path in tmp_path.iterdir()] == ["kept.json"]

    @pytest.mark.parametrize(("courant_number", "runs"), [(0.95, 1), (0.5, 4)])
    def test_shipped_ladder_serves_its_scene_at_the_default_settings(
        self, shipped: Scenario, courant_number: float, runs: int
    ) -> None:
        bench = MadeUp()
        offer = buy(shipped.replaced({"numerics.courant_number": courant_number}), accuracy=0.2, bench=bench)
        assert len(bench.ran) == runs
        assert ("shipped" in offer.source) == (runs == 1)

    def test_key_is_of_all_that_decides(self, dry: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def key(scenario: Scenario, device: str = "cpu") -> Any:
            return Kept.of(scenario, device, tmp_path)._path

        same = [dry.replaced({"numerics.spacing_m": 0.3}), dry.replaced({"title": "Another"})]
        assert {key(scenario) for scenario in same} == {key(dry)}
        others = [
            key(dry.replaced({"output.time_series_interval_s": 0.002})),
            key(dry.replaced({"numerics.courant_number": 0.5})),
            key(dry.replaced({"flow.velocity_m_per_s": [9.1, 0.0]})),
            key(dry, "cuda:0"),
        ]
        mine = key(dry)
        monkeypatch.setattr(keeping, "_machine", lambda: ["another"])
        others.append(key(dry))
        monkeypatch.setattr(keeping, "_program", lambda: ["another"])
        others.append(key(dry))
        assert len({mine, *others}) == len(others) + 1

    @pytest.mark.parametrize(
        ("platform", "variables", "folder"),
        [
            ("linux", {"XDG_CACHE_HOME": "/cache"}, "/cache/warp-mpm"),
            ("linux", {"XDG_CACHE_HOME": "relative"}, "/home/me/.cache/warp-mpm"),
            ("linux", {}, "/home/me/.cache/warp-mpm"),
            ("darwin", {"XDG_CACHE_HOME": "/cache"}, "/home/me/Library/Caches/warp-mpm"),
            ("win32", {"LOCALAPPDATA": "/local"}, "/local/warp-mpm/Cache"),
            ("win32", {}, "/home/me/AppData/Local/warp-mpm/Cache"),
            ("linux", {"WARP_MPM_CACHE_DIR": "/mine"}, "/mine"),
        ],
    )
    def test_folder_of_the_user(
        self, platform: str, variables: dict[str, str], folder: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "WARP_MPM_CACHE_DIR"):
            monkeypatch.delenv(name, raising=False)
        for name, value in variables.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setattr(keeping.sys, "platform", platform)
        monkeypatch.setattr(Path, "home", lambda: Path("/home/me"))
        assert cache_folder() == Path(folder)


class TestAsking:
    def test_a_long_run_is_asked_for(self, dry: Scenario) -> None:
        asked: list[str] = []

        def no(what: str) -> bool:
            asked.append(what)
            return False

        bench = MadeUp(speed=0.2)
        with pytest.raises(PurchaseError, match=r"--accuracy 0.4% needs a run of about .* not begun without --yes"):
            buy(dry, accuracy=0.004, bench=bench, agree=no)
        assert len(asked) == 1
        assert buy(dry, accuracy=0.004, bench=MadeUp(speed=0.2), agree=lambda what: True).time > purchase.LONG
        buy(dry, accuracy=0.1, bench=bench, agree=no)  # short: nobody is asked
        assert len(asked) == 1

    def test_long_probes_are_asked_for_and_not_asked_twice(self, wet: Scenario) -> None:
        """What cannot be short is known before anything is run, the rest when the first probe has ended."""
        slow, longer = MadeUp(speed=0.015), wet.replaced({"output.end_time_s": 1e4})
        with pytest.raises(PurchaseError, match=r"needs probes of about"):
            buy(wet, accuracy=0.1, bench=slow, agree=lambda what: False)
        assert len(slow.ran) == 1
        untouched = MadeUp()
        with pytest.raises(PurchaseError, match=r"needs probes of .* at least"):
            buy(longer, accuracy=0.1, bench=untouched, agree=lambda what: False)
        assert untouched.ran == []
        asked: list[str] = []
        buy(longer, accuracy=0.01, bench=untouched, agree=lambda what: asked.append(what) is None)
        assert len(asked) == 1

    def test_first_probe_that_turns_out_long(self, wet: Scenario) -> None:
        slow = MadeUp(speed=0.0005)
        with pytest.raises(PurchaseError, match=r"needs probes that take more than .* without --yes"):
            buy(wet, accuracy=0.1, bench=slow, agree=lambda what: False)
        assert slow.now - 100.0 < 1.1 * purchase.LONG

    def test_a_budget_is_not_asked_about(self, dry: Scenario) -> None:
        def ask(what: str) -> bool:
            raise AssertionError(what)

        assert buy(dry, budget=3600.0, bench=MadeUp(speed=0.5), agree=ask).time > purchase.LONG


class TestOddScenes:
    def test_one_probe_of_four_may_fail(self, dry: Scenario) -> None:
        depth = dry.flow.depth
        offer = buy(dry, accuracy=0.2, bench=MadeUp(fails=(depth / 6.0,)))
        assert offer.spacing <= depth / 7.0
        with pytest.raises(PurchaseError, match=r"The probe at 0\.\d+ m failed: diverged"):
            buy(dry, accuracy=0.2, bench=MadeUp(fails=(depth / 6.0, depth / 8.0)))

    def test_failed_probes_are_not_run_again(self, dry: Scenario, tmp_path: Path) -> None:
        bench, depth = MadeUp(fails=(0.5, 0.375)), dry.flow.depth
        assert depth == 3.0
        for _ in range(2):
            with pytest.raises(PurchaseError, match="failed"):
                buy(dry, accuracy=0.2, bench=bench, kept=Kept(tmp_path / "kept.json"))
        assert len(bench.ran) == 4

    def test_no_barrier(self, dry: Scenario) -> None:
        bench = MadeUp()
        with pytest.raises(PurchaseError, match="This scene has no barrier"):
            buy(dry.replaced({"barrier": None}), budget=60.0, bench=bench)
        assert bench.ran == []

    def test_flow_that_never_arrives(self, dry: Scenario) -> None:
        class Missed(MadeUp):
            def measure(self, scenario: Scenario, limit: float) -> dict[str, Any]:
                return super().measure(scenario, limit) | {"figures": {"peak_force": 0.0, "impulse": 0.0}}

        with pytest.raises(PurchaseError, match="In none of the probes did the flow reach a barrier"):
            buy(dry, budget=60.0, bench=Missed())

    def test_very_short_run(self, dry: Scenario) -> None:
        bench = MadeUp()
        offer = buy(dry.replaced({"output.end_time_s": 0.001}), budget=10.0, bench=bench)
        assert offer.time < 10.0

    def test_scene_of_too_many_points_to_be_fine(self, dry: Scenario) -> None:
        """The finest spacings of a long flow are no scenario; they are not sold, and nothing falls over."""
        long = dry.replaced({"flow.shape.squares": 2000, "output.end_time_s": 0.5})
        offer = buy(long, budget=3.6e6, bench=MadeUp())
        assert 1e7 < points_of(with_spacing(long, offer)) <= 2e7


class TestCommand:
    @pytest.fixture
    def scene(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
        """Coarser probes than those of a user, to be quick."""
        monkeypatch.setattr(purchase, "PROBE_CELLS", (3.0, 4.0, 5.0))
        monkeypatch.setenv("WARP_MPM_CACHE_DIR", str(tmp_path / "cache"))
        content = json.loads((SCENARIOS / "case_1.json").read_text())
        content["output"]["end_time_s"] = 0.8
        path = tmp_path / "scene.json"
        path.write_text(json.dumps(content))
        return path

    def test_asks_before_a_long_run(self, scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(purchase, "LONG", 2.0)
        command = ["run", str(scene), "--accuracy", "50%", "--out", str(tmp_path / "run"), "--quiet"]
        refused = CliRunner().invoke(app, command)
        assert refused.exit_code == 2
        assert refused.stderr.count("\n") == 1
        assert "that is not begun without --yes" in refused.stderr
        assert not (tmp_path / "run").exists()
        done = CliRunner().invoke(app, [*command, "--yes"])
        assert done.exit_code == 0, done.stderr
        assert (tmp_path / "run" / "summary.json").exists()
        assert list((tmp_path / "cache" / "purchases").iterdir())

    def test_interrupted_while_it_probes(self, scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        from warp_mpm.accuracy import pace

        def interrupted(self: Any, *arguments: Any) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(pace.Machine, "measure", interrupted)
        result = CliRunner().invoke(app, ["run", str(scene), "--accuracy", "50%", "--out", str(tmp_path / "run")])
        assert result.exit_code == 130
        assert "Interrupted while the scene was probed" in result.stderr
        assert not (tmp_path / "run").exists()

    def test_a_terminal_is_asked(self, monkeypatch: pytest.MonkeyPatch) -> None:
        from warp_mpm.commands import options

        class Terminal:
            def isatty(self) -> bool:
                return True

        monkeypatch.setattr(options.sys, "stdin", Terminal())
        monkeypatch.setattr(options.sys, "stderr", Terminal())
        monkeypatch.setattr(options.typer, "confirm", lambda question, err: question == "Begin?")
        assert options.agreed("Begin?")
        monkeypatch.setattr(options.sys, "stdin", None)
        assert not options.agreed("Begin?")
