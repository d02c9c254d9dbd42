"""The page and the command of the validation, on made-up cases; and that a check can fail."""

import dataclasses
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_mpm.cli import app
from warp_mpm.validation import catalogue, paper_forces
from warp_mpm.validation.case import (
    Case,
    Curve,
    Outcome,
    Panel,
    Table,
    at_most,
    compared,
    falls,
    holds,
    reference,
    reported,
    within,
)
from warp_mpm.validation.element_driver import Soil
from warp_mpm.validation.elements import slow_return
from warp_mpm.validation.refinement import pressure_residual
from warp_mpm.validation.shallow_water import jump_depth_ratio, ritter_depth

runner = CliRunner()


def made_up(name="made-up", off=0.0):
    """A case whose one gated number is `off` by a share of its reference."""

    def run(quick):
        return Outcome(
            checks=[
                compared("a length", "m", 2.0 * (1.0 + off), 2.0, 0.01, remark="it was made so"),
                reported("another", "Pa", 3.0, reference=2.0, remark="nobody knows better"),
            ],
            panels=[Panel("lengths", "x [m]", "y [m]", [reference([0, 1], [0, 1]), Curve([0, 1], [0, 1.1], "ours")])],
            tables=[Table("a table", ("a", "b"), [("1", "2")])],
            remarks=["A remark that explains."],
        )

    return Case(
        name=name, title="Made up", tests="A test.", source="a book", limit="1 %", run=run, module=Case.__module__
    )


@pytest.fixture
def only_made_up(monkeypatch):
    def use(**options):
        monkeypatch.setattr(catalogue, "CASES", (made_up(**options),))

    return use


@pytest.mark.parametrize(
    ("check", "passed"),
    [
        (compared("", "", 1.009, 1.0, 0.01), True),
        (compared("", "", 1.011, 1.0, 0.01), False),
        (compared("", "", 0.011, 0.0, 0.01, scale=1.0), False),
        (compared("", "", float("nan"), 1.0, 0.01), False),
        (at_most("", "", -0.5, 0.4), False),
        (at_most("", "", float("nan"), 0.4), False),
        (within("", "", 2.0, 1.0, 2.0), True),
        (within("", "", 2.1, 1.0, 2.0), False),
        (holds("", "", 1.0, False), False),
        (falls("", [0.04, 0.027]), True),
        (falls("", [0.04, 0.029]), False),
        (falls("", [0.04, 0.029], left=0.03), True),
        (reported("", "", 1.0, reference=9.0), None),
    ],
)
def test_a_check_can_fail(check, passed):
    assert check.passed is passed


def test_the_page_shows_numbers_reasons_and_plots(tmp_path, only_made_up):
    only_made_up(off=0.05)
    result = runner.invoke(app, ["validate", "--out", str(tmp_path)])
    assert result.exit_code == 1, result.output
    text = (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert "| **short** | a length | 2.1 m | 2 | 5 % | 1 % |" in text
    assert "*Short* (a length): it was made so." in text
    assert "*Note* (another): nobody knows better." in text
    assert "A remark that explains." in text
    assert "| 1 | 2 |" in text
    for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text):
        assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")
    assert re.search(r"\[Made up\]\(#made-up\) \| \*\*short\*\* \(1 of 1\) \| 5 \|", text)


def test_all_within_their_limits_is_exit_code_0(tmp_path, only_made_up):
    only_made_up()
    result = runner.invoke(app, ["validate", "--only", "made-up", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert "| **short** |" not in (tmp_path / "validation.md").read_text(encoding="utf-8")


def test_what_ended_before_an_interrupt_is_on_the_page(tmp_path, monkeypatch):
    def heard(quick):
        raise KeyboardInterrupt

    monkeypatch.setattr(catalogue, "CASES", (made_up(), dataclasses.replace(made_up("second"), run=heard)))
    result = runner.invoke(app, ["validate", "--out", str(tmp_path)])
    assert result.exit_code == 130
    assert "Interrupted in second; 1 of 2 cases are on the page" in result.stderr
    assert "a length" in (tmp_path / "validation.md").read_text(encoding="utf-8")


def test_a_validation_that_stopped_goes_on(tmp_path, monkeypatch):
    """The same program and question take a result over, whole; another question does not."""
    ran = []

    def counted(name):
        case = made_up(name, off=0.05)
        return dataclasses.replace(case, run=lambda quick: ran.append(name) or case.run(quick))

    def heard(quick):
        raise KeyboardInterrupt

    def validate(*cases, options=()):
        monkeypatch.setattr(catalogue, "CASES", cases)
        return runner.invoke(app, ["validate", "--out", str(tmp_path), *options])

    first, second = counted("first"), counted("second")
    assert validate(first, dataclasses.replace(second, run=heard)).exit_code == 130
    before = (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert validate(first, second, options=["--resume"]).exit_code == 1
    assert ran == ["first", "second"]
    after = (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert before[before.index("## Made up") :] in after
    assert validate(first, second, options=["--resume", "--quick"]).exit_code == 1
    assert ran == ["first", "second"] * 2
    (tmp_path / "validation" / "first.png").unlink()
    assert validate(first, second, options=["--resume", "--quick"]).exit_code == 1
    assert ran == ["first", "second"] * 2 + ["first"]
    assert validate(first, second).exit_code == 1
    assert ran == ["first", "second"] * 2 + ["first"] + ["first", "second"]


def test_kept_results_that_cannot_be_read_are_one_sentence(tmp_path, only_made_up):
    only_made_up()
    (tmp_path / "validation.json").write_text('{"made-up": 3}')
    result = runner.invoke(app, ["validate", "--resume", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert "validation.json cannot be read: " in result.stderr
    assert "without --resume it is replaced." in result.stderr


def test_an_unknown_case_is_one_sentence(tmp_path):
    result = runner.invoke(app, ["validate", "--only", "teraghi", "--out", str(tmp_path / "page")])
    assert result.exit_code == 2
    assert "--only teraghi is no validation case; it must be one of mohr-coulomb" in result.stderr
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "page").exists()


def test_a_folder_that_cannot_be_made_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    result = runner.invoke(app, ["validate", "--only", "rotation", "--out", str(tmp_path / "file" / "page")])
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1


def test_names_are_unique_and_readable():
    names = [case.name for case in catalogue.CASES]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[a-z]+(-[a-z]+)*", name) for name in names)


# -- references that the cases compute themselves ------------------------------------------------------------------


def test_the_slow_return_mapping_finds_closest_points_of_an_associated_cone():
    """With psi = phi the answer is the admissible stress closest in the energy norm: no neighbour is closer."""
    soil = Soil(friction=30.0, dilatancy=30.0, cohesion=5e3, tension=2e3)
    rng = np.random.default_rng(3)
    trial = rng.normal(0.0, 2e4, (40, 3))
    found = slow_return(soil, trial)
    compliance = np.linalg.inv(soil.lame * np.ones((3, 3)) + 2.0 * soil.shear * np.eye(3))

    def energy(stress):
        return np.einsum("ni,ij,nj->n", trial - stress, compliance, trial - stress)

    def admissible(stress):
        ordered = np.sort(stress, axis=1)
        cone = (1 + soil.sin_friction) * ordered[:, 2] - (1 - soil.sin_friction) * ordered[:, 0]
        return (cone <= soil.cohesion_term + 1e-6) & (ordered[:, 2] <= soil.tension + 1e-6)

    assert admissible(found).all()
    for _ in range(300):
        other = found + rng.normal(0.0, 300.0, found.shape)
        allowed = admissible(other)
        assert (energy(other)[allowed] >= energy(found)[allowed] - 1e-9).all()


@pytest.mark.parametrize(("froude", "ratio"), [(1.0, 2.17009), (1.843, 3.28183), (3.0, 4.86399), (5.0, 7.64977)])
def test_the_jump_conserves_momentum(froude, ratio):
    x = jump_depth_ratio(froude)
    assert x == pytest.approx(ratio, abs=1e-5)
    # Seen from the bore, of speed u = v/(x - 1), momentum flux and pressure agree on both sides (unit depth, g = 1).
    speed = froude / (x - 1.0)
    arriving = (froude + speed) ** 2 + 0.5
    assert arriving == pytest.approx(speed**2 * x + 0.5 * x**2, rel=1e-12)


def test_the_dam_break_keeps_its_volume():
    x = np.linspace(-30.0, 30.0, 600_001)
    depth = ritter_depth(x, 2.0, 1.0)
    assert np.trapezoid(depth, x) == pytest.approx(30.0, rel=1e-6)


def test_the_pressure_residual_sees_noise_and_not_a_plane():
    rng = np.random.default_rng(5)
    grid = (np.arange(40) + 0.5) * 0.1
    position = np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1).reshape(-1, 2)
    inner = ((position > 0.5) & (position < 3.5)).all(axis=1)
    volume = np.full(len(position), 0.01)
    plane = 3e3 * position[:, 0] - 2e3 * position[:, 1]
    assert np.abs(pressure_residual(position, plane, volume, 0.2)[inner]).max() < 1e-8
    noise = rng.normal(0.0, 1e3, len(position))
    left = pressure_residual(position, plane + noise, volume, 0.2)[inner]
    assert 0.5e3 < left.std() < 1e3


# -- the paper's force, on stand-in runs -----------------------------------------------------------------------------


def stand_in(level):
    """A run of case 1 whose force rises to a level [N/m] within 0.1 s, and overshoots it by a tenth for 20 ms."""
    time = np.arange(1301) * 1e-3
    force = level * np.clip((time - 0.3) / 0.1, 0.0, 1.0)
    force[500:520] *= 1.1
    means = [paper_forces.moving_mean(time, force, window) for window in paper_forces.WINDOWS]
    return paper_forces.Peaks(
        np.array([mean.max() for mean in means]), np.full(5, 0.2), level, 1e5, {"time": time, "impact_force_x": force}
    )


@pytest.mark.parametrize(("level", "passed"), [(404e3, True), (500e3, False)])
def test_the_papers_force_is_judged_by_its_sustained_level(monkeypatch, level, passed):
    monkeypatch.setattr(paper_forces, "peaks_of", lambda name, spacing: stand_in(level))
    outcome = paper_forces.forces(quick=True)
    assert outcome.checks[0].passed is passed
    lambdas = [check for check in outcome.checks if check.quantity.startswith("λ")]
    assert [check.reference for check in lambdas] == ["0.72", "0.41"]
    # 0.75 m v²/(F L) over 50 ms, of which 20 ms are a tenth higher.
    assert lambdas[0].ours == pytest.approx(0.75 * 81000.0 * 100.0 / (1.04 * level) / 15.0, rel=0.01)
    assert "needs a peak of 562 kN/m" in lambdas[0].remark
    by_window = next(table for table in outcome.tables if table.title.startswith("λ and τ of case 1, fixed"))
    assert [row[0] for row in by_window.rows] == ["1 ms", "5 ms", "20 ms", "50 ms", "100 ms"]
    forces = next(table for table in outcome.tables if "greatest moving mean" in table.title)
    assert len(forces.rows) == len(paper_forces.THEIRS) + 2
