"""The cases held against measurements: reader of tables, judgement on stand-in runs, page and command; and one coarse
run of water on a wall. The cases themselves with `slow`."""

import inspect
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.validation import page
from warp_mpm.validation.case import Band, Check, Outcome, Panel, compared, reported
from warp_mpm.validation.measured import catalogue, debris_flume, loose_wedge, water_on_a_wall
from warp_mpm.validation.measured.given import SMOOTH, Given, Ladder, measured_case, simulated
from warp_mpm.validation.measured.tables import KNOWN, Tables, read_table
from warp_mpm.validation.measured.water import RECORD, WALL, Setup, Watched, best_shift, spacings, watch
from warp_mpm.validation.scenes import scene

runner = CliRunner()

FRONTS = "lobovsky2014_fronts"


# -- tables ------------------------------------------------------------------------------------------------------


def written(tmp_path, text, name=FRONTS):
    file = tmp_path / f"{name}.csv"
    file.write_text(text, encoding="utf-8")
    return file


def test_a_table_is_read_by_its_header(tmp_path):
    file = written(tmp_path, "# SOURCE: a book\n# UNITS: none\nH_m,extra,t_star,x_over_H\n0.3,a,0,0\n\n0.6,b,1,2.5\n")
    table = read_table(file, KNOWN[FRONTS])
    assert table.numbers("t_star").tolist() == [0.0, 1.0]
    assert table.numbers("x_over_H", where={"H_m": "0.6"}).tolist() == [2.5]
    tables = Tables(tmp_path)
    assert tables.names == (FRONTS,)
    assert tables.get("buchner2002_wall_pressure") is None


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("H_m,t_star\n0.3,0\n0.3,1\n", r"has no column x_over_H; it must have H_m, t_star, x_over_H\."),
        ("H_m,t_star,x_over_H\n0.3,0,1\n", r"has 1 rows; it must have at least two\."),
        ("", r"has no column H_m"),
        ("# a\nH_m,t_star,x_over_H\n0.3,0,1\n0.3,1\n", r"line 4 has 2 values; it must have 3\."),
        ("H_m,t_star,x_over_H\n0.3,0,1\n0.3,one,2\n", r"line 3: t_star = 'one' must be a number\."),
        ("H_m,t_star,x_over_H\n0.3,0,1\n0.3,nan,2\n", r"line 3: t_star = 'nan' must be a number\."),
    ],
)
def test_a_table_that_is_none_is_one_sentence(tmp_path, text, sentence):
    file = written(tmp_path, text)
    with pytest.raises(ValueError, match=sentence) as found:
        read_table(file, KNOWN[FRONTS])
    assert str(file) in str(found.value)
    result = runner.invoke(app, ["validate", "--measured", "--data", str(tmp_path), "--out", str(tmp_path / "page")])
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "page").exists()


def test_a_table_of_bytes_is_one_sentence(tmp_path):
    file = tmp_path / f"{FRONTS}.csv"
    file.write_bytes(b"\xff\xfe\x00\x80\n")
    with pytest.raises(ValueError, match="is no text file"):
        Tables(tmp_path)
    assert file.exists()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--measured", "--data", "{}/none"], "is no folder; it must hold tables of measurements."),
        (["--measured", "--data", "{}"], "holds no table of measurements; it must hold some of lobovsky2014_H300"),
        (["--data", "{}"], "--data needs --measured"),
        (["--finer", "2"], "--finer needs --measured"),
        (["--measured", "--finer", "0"], "--finer"),
        (["--measured", "--only", "water"], "--only water is no validation case; it must be one of water-on-a-wall"),
    ],
)
def test_options_that_cannot_be_used_are_one_sentence(tmp_path, arguments, sentence):
    given = [argument.format(tmp_path) for argument in arguments]
    result = runner.invoke(app, ["validate", *given, "--out", str(tmp_path / "page")])
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert not (tmp_path / "page").exists()


# -- what is read of a run -----------------------------------------------------------------------------------------


def made_up(time, front=None, levels=None, pressure=None, cells=60):
    """A run of these curves; `pressure` gives p* [T] of a slot by its number."""
    edges = np.linspace(0.0, 2.0, 2 * cells + 1)
    loads = np.zeros((len(time), 2 * cells))
    if pressure is not None:
        loads = np.stack([pressure(slot) for slot in range(2 * cells)], axis=1) / cells
    count = len(time)
    return Watched(
        cells,
        time,
        np.zeros(count) if front is None else front,
        np.zeros((count, 4)) if levels is None else levels,
        edges,
        loads,
    )


def test_a_sensor_reads_the_pressure_at_its_height():
    time = np.arange(1, 6) * RECORD
    run = made_up(time, pressure=lambda slot: np.full(5, 1.0 - (slot + 0.5) / 60))
    for height in (0.1, 0.5, 0.75):
        assert run.pressure(height, 0.15) == pytest.approx(np.full(5, 1.0 - height), abs=1e-12)
    # A sensor at the bed is moved up, so that all of it is wet; a narrow one is a mean over two cells.
    assert run.pressure(0.0, 0.2) == pytest.approx(np.full(5, 0.9), abs=1e-12)
    assert run.pressure(0.5, 0.001) == pytest.approx(np.full(5, 0.5), abs=1e-12)


@pytest.mark.parametrize("shift", [-0.15, 0.0, 0.1])
def test_the_shift_of_a_clock_is_found(shift):
    time = np.arange(1, 301) * RECORD
    run = made_up(time, front=time**1.5)
    theirs = np.array([1.0, 2.0, 3.0])
    assert best_shift([(run, run.front, theirs, (theirs - shift) ** 1.5)]) == pytest.approx(shift, abs=0.0051)
    # No more than is allowed, however far the clocks are apart.
    assert best_shift([(run, run.front, theirs, (theirs - 0.7) ** 1.5)]) == pytest.approx(0.2)


# -- the judgement -------------------------------------------------------------------------------------------------


def as_measured(factor=1.0, late=0.0, levels=1.0):
    """A run of what Lobovský measured, with pressures times a factor, later by a time, and levels times a factor."""
    time = np.arange(1, round(WALL.end / RECORD) + 1) * RECORD
    traces = []
    for name, arrival in water_on_a_wall.ARRIVALS.items():
        means, peak = water_on_a_wall.MEANS[name], water_on_a_wall.PEAKS[name][0] * water_on_a_wall.MBAR
        clock = time - late - 0.5 * RECORD
        trace = np.zeros(len(time))
        spike = (clock > arrival) & (clock <= arrival + 0.11)
        trace[spike] = peak
        rest = (clock > arrival + 0.11) & (clock <= 3.0)
        known = 0.5 * sum(means) + 0.15 * means[-1] + spike.sum() * RECORD * peak
        trace[rest] = (water_on_a_wall.IMPULSES[name] - known) / (rest.sum() * RECORD)
        for begin, mean in zip(water_on_a_wall.WINDOWS, means, strict=True):
            trace[(clock > begin) & (clock <= begin + 0.5)] = mean
        trace[clock > 7.0] = means[-1]
        traces.append(factor * trace)
    # Two cells at 1/60 of each sensor.
    slots = np.searchsorted([2, 5, 10], np.arange(120), side="right")
    stepped = np.zeros((len(time), 4))
    for k, one in enumerate(water_on_a_wall.LEVELS.values()):
        for at, value in zip(water_on_a_wall.LEVEL_TIMES, one, strict=True):
            stepped[np.abs(time - at) <= 0.5, k] = levels * value
    front = np.interp(time, *water_on_a_wall.FRONT.T)
    return made_up(time, front=front, levels=stepped, pressure=lambda slot: traces[slots[slot]])


def judged(monkeypatch, run):
    monkeypatch.setattr(water_on_a_wall, "watch", lambda setup, cells, gauges: run)
    monkeypatch.setattr(water_on_a_wall, "_RUNS", {})
    return water_on_a_wall.lobovsky(Given(quick=True))


def test_what_was_measured_is_within_its_limits(monkeypatch):
    outcome = judged(monkeypatch, as_measured())
    assert [check.quantity for check in outcome.short] == []
    assert len([check for check in outcome.checks if check.passed]) == 23
    assert all(point.computed == pytest.approx(point.measured, rel=0.02) for point in outcome.points
               if point.by == SMOOTH and "lowest" not in point.quantity and "slope" not in point.quantity
               )  # fmt: skip


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"factor": 1.2}, {"∫ p* dt* until 7.15", "window means"}),
        ({"factor": 0.7}, {"∫ p* dt* until 7.15", "window means", "greatest p*, mean over 0.1 t*"}),
        ({"late": 0.6}, {"shift of the clock of the pressures"}),
        ({"levels": 1.3}, {"level at x = 0.3 m"}),
    ],
)
def test_what_was_not_measured_falls_short(monkeypatch, change, words):
    short = [check.quantity for check in judged(monkeypatch, as_measured(**change)).short]
    for word in words:
        assert any(word in quantity for quantity in short), short


def test_a_clock_within_its_limit_is_shifted(monkeypatch):
    outcome = judged(monkeypatch, as_measured(late=0.14))
    assert [check.quantity for check in outcome.short] == []
    shift = next(check for check in outcome.checks if check.quantity == "shift of the clock of the pressures")
    assert shift.ours == pytest.approx(-0.14, abs=1.01 * RECORD)  # an arrival is known to a record


def passed(factor=1.0, late=0.0):
    """A release whose gauges see what the ensemble without mud did, times a factor, later by a time."""
    time = np.arange(1, 441) * debris_flume.RECORD
    columns = {}
    for key, values, later, unit in (
        ("depth", debris_flume.DEPTHS, debris_flume.LATER, 1.0),
        ("stress", debris_flume.STRESSES, debris_flume.LATER[1:], 1e3),
        ("pressure", debris_flume.PRESSURES, debris_flume.LATER[1:], 1e3),
    ):
        rows = []
        for place in debris_flume.PLACES:
            mean = np.array(values.get(("SG", place), [(0.0, 0.0)] * len(later)))[:, 0] * factor * unit
            at = debris_flume.ARRIVALS["SG", place] + late + np.array(later)
            rows.append(np.where(time > at[0] - 1.0, np.interp(time, at, mean), 0.0))
        columns[key] = np.array(rows).T
    return debris_flume.Passed(time, columns["depth"], columns["stress"], columns["pressure"])


def flume(monkeypatch, run, case=debris_flume.debris_flume):
    monkeypatch.setattr(debris_flume, "run_down", lambda setting, spacing: run)
    return case(Given(quick=True))


FLUMES = pytest.mark.parametrize(
    "case",
    [debris_flume.debris_flume, debris_flume.debris_flume_dilatancy, debris_flume.debris_flume_viscous],
)


@FLUMES
def test_the_flume_is_judged_behind_the_front(monkeypatch, case):
    assert flume(monkeypatch, passed(), case).short == []
    short = [check.quantity for check in flume(monkeypatch, passed(factor=1.8), case).short]
    assert len(short) == 4
    assert all("share of the times behind the front" in quantity for quantity in short)
    on_the_pad = passed()
    on_the_pad.depth[:, 2] *= 1.8
    (wrong,) = flume(monkeypatch, on_the_pad, case).short
    assert wrong.quantity.startswith("depth at 90 m")
    late = [check.quantity for check in flume(monkeypatch, passed(late=1.5), case).short]
    assert late == ["arrival at 32 m", "arrival at 66 m"]


def test_a_flow_that_never_arrives_falls_short(monkeypatch):
    outcome = flume(monkeypatch, passed(factor=0.1))
    assert len(outcome.short) == 7
    assert [point for point in outcome.points if not np.isfinite(point.computed)] == []


@FLUMES
def test_every_run_of_the_flume_is_of_the_published_ranges(monkeypatch, case):
    """But for the friction of three variants, which say so: a bed without bumps, one that holds, and a material that
    shears as the bed does."""
    settings = []

    def noted(setting, spacing, end=0.0):
        settings.append(setting)
        return passed()

    monkeypatch.setattr(debris_flume, "run_down", noted)
    outcome = case(Given())
    for setting in settings:
        assert 38.0 <= setting.friction <= 43.0
        assert 1e-12 <= setting.permeability <= 1e-8
        assert 0.005 <= setting.fluid <= 0.05
        assert setting.critical is None or 0.62 <= setting.critical <= 0.66
        assert setting.viscous is None or 2.1 <= setting.viscous <= 9.5
        assert not setting.held or "bed that holds" in setting.words
    rows = outcome.tables[1].rows
    assert len(rows) == len(set(settings)) + 1  # and what was measured
    assert {row[0] for row in rows[:-1]} == {setting.words for setting in settings}


def test_a_viscosity_of_the_flume_is_the_law_s():
    setting = debris_flume.Setting(critical=0.64, viscous=2.1)
    made = scene("a", debris_flume.HOPPER, "two_phase", end_time=1.0, soil=setting.soil)
    assert made.flow.material.law == "coulomb_viscous"
    assert made.flow.material.mixture_viscosity_Pa_s == 2.1
    assert made.flow.material.friction_angle_deg == 40.7
    assert made.flow.material.dilatancy.critical_solid_fraction == 0.64
    assert "mixture_viscosity_Pa_s" not in debris_flume.Setting().soil


def test_the_flume_bends_to_its_pad():
    """The way down the bed and the height over it, of points 0.1 m over its slope, its arc and its pad."""
    corners = np.array(debris_flume.profile())
    turn = np.radians(debris_flume.TURN)
    arc = np.array([82.5 + 9.9 * np.sin(0.5 * turn), 10.0 - 9.9 * np.cos(0.5 * turn)])
    pad = np.array([82.5 + 9.9 * np.sin(turn), 10.0 - 9.9 * np.cos(turn)]) + 2.0 * np.array(
        [np.cos(turn), np.sin(turn)]
    )
    x, y = np.array([[32.0, 0.1], arc, pad]).T
    way, height, angle = debris_flume.along(x, y)
    assert way == pytest.approx([32.0, 82.5 + 5.0 * turn, 82.5 + 10.0 * turn + 2.0], rel=1e-12)
    assert height == pytest.approx(0.1, rel=1e-9)
    assert angle == pytest.approx([0.0, 0.5 * turn, turn], rel=1e-12)
    on_bed = debris_flume.along(*corners[1:].T)
    assert np.abs(on_bed[1]).max() < 1e-9
    assert on_bed[0][-1] > debris_flume.PLACES[-1] + 1.0


def test_a_gauge_on_the_pad_sees_the_stress_normal_to_it():
    turn = np.radians(debris_flume.TURN)
    along = np.array([np.cos(turn), np.sin(turn)])
    normal = np.array([-np.sin(turn), np.cos(turn)])
    foot = np.array([82.5 + 10.0 * np.sin(turn), 10.0 - 10.0 * np.cos(turn)])
    place = foot + (90.0 - 82.5 - 10.0 * turn) * along + 0.05 * normal
    tensor = -3000.0 * np.outer(normal, normal) - 1000.0 * np.outer(along, along)
    points = {
        "position": place[None],
        "volume": np.array([0.1]),
        "effective_stress": np.array([[tensor[0, 0], tensor[1, 1], 0.0, tensor[0, 1], 0.0, 0.0]]),
        "pore_pressure": np.array([500.0]),
    }
    found = debris_flume.at_gauges(points, 0.1)
    assert found[:2] == [(0.0, 0.0, 0.0)] * 2
    assert found[2] == pytest.approx((0.2, 3500.0, 500.0), rel=1e-9)


def test_the_wedge_lies_on_what_it_failed_on():
    """The published points, on a curve of the fourth order, and 2.8 m² of soil above."""
    x, y = np.array(loose_wedge.ground()).T
    published = np.array(loose_wedge.BED)
    assert np.interp(published[:, 0], x, y) == pytest.approx(published[:, 1], abs=2e-3)
    assert np.all(np.diff(x) > 0.0)
    corners = np.array(loose_wedge.outline())
    area = 0.5 * np.sum(corners[:, 0] * np.roll(corners[:, 1], -1) - np.roll(corners[:, 0], -1) * corners[:, 1])
    assert area == pytest.approx(0.65 * (4.516 + 0.5 * 1.082) - 0.45, rel=0.005)  # less what stays


# -- page and command ----------------------------------------------------------------------------------------------


def a_case(given: Given) -> Outcome:
    """A length within 1 %: it was measured to half of that."""
    ladder = Ladder(["0.2 m", "0.1 m"])
    ours = [2.4, 2.1]
    ladder.add(compared("a length", "m", ours[-1], 2.0, 0.01), ours, measured=(2.0, 1.9, 2.1))
    ladder.points.append(simulated("nothing", 0.0, [1.0, 1.0]))
    assert given.finer == 3
    return Outcome(checks=ladder.checks, points=ladder.points, tables=[ladder.table], panels=[Panel("p", "x", "y", [])])


def test_the_page_shows_the_limit_with_its_reason_as_it_stands_in_the_docstring(tmp_path, monkeypatch):
    monkeypatch.setattr(
        catalogue, "measured_cases", lambda given: (measured_case("a", "A case", "A test.", "a book", a_case, given),)
    )
    result = runner.invoke(app, ["validate", "--measured", "--finer", "3", "--out", str(tmp_path)])
    assert result.exit_code == 1, result.output
    text = (tmp_path / "measured.md").read_text(encoding="utf-8")
    assert "**Set before the run.** A length within 1 %: it was measured to half of that." in text
    assert "| **short** | a length | 2.1 m | 2 | 5 % | 1 % |" in text
    assert "| a length | m | 2 | 2.4 | 2.1 |" in text
    assert "spacings over 3, no tables of measured curves" in text
    assert "`--measured --only a`" in text
    for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text):
        assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")
    assert "measured/everything.png" in text
    assert not (tmp_path / "validation.md").exists()


def test_the_picture_of_everything_has_a_point_for_each_figure_that_can_be_drawn():
    points = [simulated("a", 1.0, [1.5, 1.2], band=(0.8, 1.3)), simulated("b", 0.0, [1.0]), simulated("c", 2.0, [3.0])]
    points += [simulated("too low", 1.0, [0.5]), replace(simulated("d", 2.0, [2.6], by="a formula"), label="Formula")]
    figure = page.everything([Outcome(checks=[], points=points)])
    (axes,) = figure.axes
    assert axes.get_xscale() == axes.get_yscale() == "log"
    told = [text.get_text() for text in axes.get_legend().get_texts()]
    assert told == ["water, smooth bed: 1 of 3", "a formula: 0 of 1"]
    assert [text.get_text() for text in axes.texts] == ["Formula"]
    assert page.everything([Outcome(checks=[])]) is None


def test_the_picture_of_everything_keeps_a_figure_of_which_nothing_is_left():
    points = [simulated("a", 1.0, [1.1]), simulated("passed already", 2.0, [0.0])]
    (axes,) = page.everything([Outcome(checks=[], points=points)]).axes
    hollow = [line for line in axes.lines if line.get_markerfacecolor() == "none"]
    assert [(line.get_xdata().tolist(), line.get_ydata().tolist()) for line in hollow] == [
        ([2.0], [axes.get_ylim()[0]])
    ]
    assert axes.get_legend().get_texts()[0].get_text().endswith("1 of 2")


def test_two_bands_of_a_panel_are_told_apart():
    bands = [Band([0.0, 1.0], [0.0, 0.0], [1.0, 1.0], name) for name in ("one", "other")]
    (axes,) = page.drawn([Panel("p", "x", "y", [], bands=bands)]).axes
    one, other = (shade.get_facecolor()[0, :3].tolist() for shade in axes.collections)
    assert one != other


def test_a_verdict_counts_the_judged_alone():
    checks = [compared("a", "m", 2.0, 1.0, 0.1), compared("b", "m", 1.0, 1.0, 0.1), reported("c", "m", 1.0)]
    assert page.verdict(Outcome(checks=checks)) == "**short** (1 of 2)"
    assert page.verdict(Outcome(checks=checks[1:])) == "ok"
    assert page.verdict(Outcome(checks=checks[2:])) == "reported"


@pytest.mark.parametrize("name", ["measured", "validation"])
def test_the_verdicts_of_a_shipped_page_are_those_of_its_tables(name):
    text = (Path(__file__).parents[2] / "docs" / f"{name}.md").read_text(encoding="utf-8")
    first, *sections = text.split("\n## ")
    told = re.findall(r"(?m)^\| \[.*\]\(#.*\) \| (\S.*?) \| .* \| .* s \|$", first)
    assert len(told) == len(sections) > 5
    for verdict, section in zip(told, sections, strict=True):
        short, ok = (len(re.findall(rf"(?m)^\| {mark} \|", section)) for mark in (r"\*\*short\*\*", "ok"))
        found = f"**short** ({short} of {short + ok})" if short else "ok" if ok else "reported"
        assert verdict == found, section.splitlines()[0]


def test_every_case_states_its_limit_before_it_runs():
    cases = catalogue.measured_cases(Given())
    names = [case.name for case in cases]
    assert len(set(names)) == len(names)
    for case in cases:
        assert re.fullmatch(r"[a-z]+(-[a-z]+)*", case.name)
        assert case.set_before
        assert len(case.limit) > 100
    assert inspect.getdoc(water_on_a_wall.lobovsky) == cases[0].limit


def test_spacings_can_be_divided():
    assert spacings(Given()) == (15, 30, 60)
    assert spacings(Given(quick=True, finer=2)) == (20, 40)


# -- runs ----------------------------------------------------------------------------------------------------------


def test_water_runs_onto_a_wall():
    """As coarse as it can be: the front arrives, and what stands before the wall presses on it."""
    run = watch(Setup(width=2.0, bed=WALL.bed, end=4.5, wall=True, ceiling=2.0), 8, [1.0, 4.5])
    pressure = run.pressure(0.125, 0.25)
    arrival = run.time[np.argmax(pressure > 0.1)]
    assert 2.0 < arrival < 2.8
    assert run.front.max() == pytest.approx(WALL.bed - 2.0, abs=0.13)
    assert np.polyfit(run.time[60:100], run.front[60:100], 1)[0] == pytest.approx(1.57, rel=0.25)
    after = (run.time > 3.3) & (run.time < 4.5)
    # The experiment has 0.6 there. On a smooth bed the water is faster: up to its stagnation pressure, 1.57²/2.
    assert 0.5 < pressure[after].mean() < 1.2
    assert run.levels[0, 0] == pytest.approx(1.0, abs=0.02)
    assert run.levels[-1, 0] < 0.7


KNOWN_SHORT: dict[str, tuple[str, ...]] = {
    "water-on-a-wall": ("∫ p* dt*", "window means", "greatest p*", "front, rms", "x = 1.114 m", "x = 1.3625 m"),
    "water-behind-a-gate": ("30 mm: ∫", "80 mm: ∫", "window means", "greatest p*", "x = 1.114 m", "x = 1.3625 m"),
    "buchner-wall": ("P1: mean", "P1: first peak"),
    "fronts": ("n² = 1, a = 57 mm: front", "H = 0.6 m: front", "Koshizuka and Oka, n² = 2: front"),
    "loose-wedge": ("head in the middle", "way of the surface"),
    "debris-flume": ("share of the times behind the front", "arrival at"),
    "debris-flume-dilatancy": ("share of the times behind the front", "arrival at"),
    "debris-flume-viscous": ("share of the times behind the front", "arrival at"),
}
"""Checks that miss their limit today, by words of their quantity; the page tells why."""


@pytest.mark.slow
@pytest.mark.parametrize("case", catalogue.measured_cases(Given()), ids=lambda case: case.name)
def test_full(case):
    short: list[Check] = case.run(False).short
    known = KNOWN_SHORT.get(case.name, ())
    assert [check.quantity for check in short if not any(words in check.quantity for words in known)] == []
