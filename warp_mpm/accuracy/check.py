"""Whether what is bought is what is got: on scenes that nobody measured before."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from analytic.whole_file import write_whole
from warp_mpm.accuracy.kept import Kept
from warp_mpm.accuracy.keys import run_key
from warp_mpm.accuracy.offer import Offer, PurchaseError, figures_of
from warp_mpm.accuracy.purchase import buy
from warp_mpm.accuracy.runner import Result, run_settings
from warp_mpm.accuracy.spacings import aligned
from warp_mpm.accuracy.study import Setting, refined_everything, without_effects
from warp_mpm.scenario import Scenario

SCENES, SEED = 10, 20261130
"""Scenes drawn, and of what the draw begins."""

ASKED = (0.05, 0.10, 0.20, 0.50)
"""Accuracies asked for in turn, until one is granted, in every other scene."""

BUDGET = 20.0
"""Time asked for in the others [s]: a spacing finer than the probes'."""

RANGES = (
    *((8.0, 16.0, 1), (2.0, 4.0, 1), (50.0, 80.0, 0), (5.0, 7.0, 1)),
    *((1600.0, 2600.0, -1), (0.2, 0.4, 2), (15.0, 30.0, 0)),
)
"""Least, greatest, digits of what is drawn: speed [m/s], depth [m], angle [°] of the face, height [m] of the barrier,
its density [kg/m³], friction of its base [-], the flow's friction angle [°]."""

TRUE_CELLS, FINER = 18.0, 2.0
"""Least cells in the flow's depth of the run that counts as the truth, and how much finer it is than what is checked;
its time step, filters, points and records are refined besides."""

TIME_FACTOR, ERROR_FACTOR, LEAST_SHARE = 1.5, 2.0, 0.9
"""How far time and error may be off what was promised, and in what share of the scenes both must hold."""


@dataclass(frozen=True)
class Check:
    """What was promised for one scene, and what was got."""

    scene: str
    spacing: float
    """Chosen [m]."""
    true_spacing: float
    """Of the run that counts as the truth, in which all else is refined too [m]."""
    asked: str
    """Accuracy that was granted, or budget."""
    promised_error: float
    true_error: float
    """Greatest of the key quantities' relative errors."""
    worst: str
    """The quantity that has it."""
    promised_time: float
    achieved_time: float
    """[s] on a free core: of the processor, the whole command and the probing where a time was asked for."""

    @property
    def time_holds(self) -> bool:
        """Within the factor, either way."""
        return 1.0 / TIME_FACTOR <= self.achieved_time / self.promised_time <= TIME_FACTOR

    @property
    def error_holds(self) -> bool:
        """Within the factor."""
        return self.true_error <= ERROR_FACTOR * self.promised_error


def drawn(base: Scenario, count: int = SCENES, seed: int = SEED) -> list[Scenario]:
    """Scenes around one with a trapezoidal barrier: another speed, depth, barrier and friction; every third is fixed,
    every other pair is dry.

    Raises:
        ValueError: the scene has no such barrier, or its flow is not given by a depth.
    """
    random, found = np.random.default_rng(seed), []
    for number in range(count):
        fixed = number % 3 == 2
        speed, depth, angle, height, density, base_friction, internal = (
            round(float(random.uniform(low, high)), digits) for low, high, digits in RANGES
        )
        changes = {
            "flow.velocity_m_per_s": [speed, 0.0],
            "flow.shape.depth_m": depth,
            "flow.material.friction_angle_deg": internal,
            "barrier.shape.base_width_m": None,
            "barrier.shape.height_m": height,
            "barrier.shape.face_angle_deg": angle,
            "barrier.motion": {"kind": "fixed"}
            if fixed
            else {"kind": "sliding", "density_kg_per_m3": density, "base_friction": base_friction},
            "title": f"{speed:g} m/s, depth {depth:g} m, φ {internal:g}°, barrier {height:g} m at {angle:g}°, "
            + ("fixed" if fixed else f"{density:g} kg/m³ on μ {base_friction:g}"),
        }
        scene = base.replaced(changes)
        dry = without_effects(scene).get("dry") if number % 4 in (1, 2) else None
        found.append(scene if dry is None else dry.replaced({"title": f"dry, {scene.title}"}))
    return found


@dataclass(frozen=True)
class Got:
    """What was promised for one scene and what its run gave, before the truth is known."""

    scene: str
    spacing: float
    asked: str
    promised_error: float
    promised_time: float
    achieved_time: float
    figures: dict[str, float]
    """Those of the run for which an error was promised, SI."""

    def held_against(self, truth: Setting, result: Result) -> Check:
        """The promise beside what is true.

        Raises:
            ValueError: the run that counts as the truth did not come to its end.
        """
        if result["status"] != "finished":
            raise ValueError(f"The finer run of the scene {self.scene} failed: {result['problem']}")
        true = {name: result["figures"][name] for name in self.figures}
        errors = {name: abs(value - true[name]) / abs(true[name]) for name, value in self.figures.items() if true[name]}
        worst = max(errors, key=lambda name: errors[name])
        return Check(
            scene=self.scene,
            spacing=self.spacing,
            true_spacing=truth.spacing,
            asked=self.asked,
            promised_error=self.promised_error,
            true_error=errors[worst],
            worst=worst.replace("barrier_displacement_final", "sliding distance").replace("_", " "),
            promised_time=self.promised_time,
            achieved_time=self.achieved_time,
        )


def check(
    scenes: Sequence[Scenario],
    folder: Path,
    *,
    jobs: int = 1,
    on_progress: Callable[[str], None] = lambda line: None,
) -> list[Check]:
    """Buy, run and compare; what was bought or run before is not bought or run again.

    Args:
        scenes: to check.
        folder: of the results, some files for each scene; made if need be.
        jobs: finer runs at the same time; what is bought runs alone, as its time is looked at.
        on_progress: told each result.

    Raises:
        ValueError: the finer run of a scene failed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    got = []
    for number, scene in enumerate(scenes, 1):
        path = folder / f"{run_key(scene)}.json"
        if not path.is_file():
            write_whole(path, json.dumps(asdict(_got(scene, BUDGET if number % 2 == 0 else None)), ensure_ascii=False))
        one = Got(**json.loads(path.read_text(encoding="utf-8")))
        on_progress(
            f"{number} of {len(scenes)}: {one.scene}: promised {one.promised_error:.1%} in {one.promised_time:.2g} s, "
            f"run in {one.achieved_time:.2g} s"
        )
        got.append(one)
    truths = [truth_of(scene, one.spacing) for scene, one in zip(scenes, got, strict=True)]
    results = run_settings(
        truths,
        folder / "truths",
        jobs=jobs,
        on_progress=lambda progress: on_progress(
            f"finer runs: {progress.done} done, {len(progress.running)} running, {progress.left} left"
        ),
    )
    return [one.held_against(truth, results[truth.key]) for one, truth in zip(got, truths, strict=True)]


def truth_of(scene: Scenario, spacing: float) -> Setting:
    """The run that counts as the truth for a run at a spacing [m]: refined in everything."""
    return refined_everything(scene, aligned(scene, min(scene.flow.depth / TRUE_CELLS, spacing / FINER)))


def table(checks: Sequence[Check]) -> str:
    """What came of it, in Markdown, with the verdict below."""
    lines = [
        "| scene | asked | spacing | the truth's | error: promised | true | of | time: promised | achieved | holds |",
        "|---|---:|---:|---:|---:|---:|---|---:|---:|---|",
    ]
    for one in checks:
        holds = {
            (True, True): "yes",
            (True, False): "not the time",
            (False, True): "not the error",
            (False, False): "no",
        }
        lines.append(
            f"| {one.scene} | {one.asked} | {one.spacing:.3g} m | {one.true_spacing:.3g} m | "
            f"{one.promised_error:.1%} | {one.true_error:.1%} | {one.worst} | "
            f"{one.promised_time:.2g} s | {one.achieved_time:.2g} s | {holds[one.error_holds, one.time_holds]} |"
        )
    both = sum(one.error_holds and one.time_holds for one in checks)
    within = sum(one.true_error <= one.promised_error for one in checks)
    lines += [
        "",
        f"In {both} of {len(checks)} scenes the time was within a factor {TIME_FACTOR:g} of the promised, and the true "
        f"error within {ERROR_FACTOR:g} times the promised, in {within} no greater than promised. The truth is a run "
        f"refined in everything: half the spacing and {TRUE_CELLS:g} cells or more in the flow's depth, half the time "
        "step, half of every filter and of the transfer's loss, more points to a cell, half the record interval.",
    ]
    return "\n".join(lines) + "\n"


def holds(checks: Sequence[Check]) -> bool:
    """Whether time and error hold in nine of ten."""
    return sum(one.error_holds and one.time_holds for one in checks) >= LEAST_SHARE * len(checks)


def _got(scene: Scenario, budget: float | None) -> Got:
    with tempfile.TemporaryDirectory() as name:  # what others have kept is not what is checked
        offer, asked = _bought(scene, budget, Kept(Path(name) / "kept.json"))
    chosen = scene.replaced({"numerics.spacing_m": offer.spacing})
    with tempfile.TemporaryDirectory() as name:
        file, run = Path(name) / "scene.json", Path(name) / "run"
        file.write_text(json.dumps(chosen.resolved()), encoding="utf-8")
        before = os.times()
        subprocess.run(
            [sys.executable, "-m", "warp_mpm", "run", str(file), "--out", str(run), "--quiet"],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        after = os.times()
        figures = figures_of(run)
    achieved = after.children_user + after.children_system - before.children_user - before.children_system
    probing = offer.probing if budget is not None else 0.0  # an accuracy promises the time of the run alone
    return Got(
        scene=scene.title,
        spacing=offer.spacing,
        asked=asked,
        promised_error=offer.error,
        promised_time=offer.time + probing,
        achieved_time=achieved + probing,
        figures={name: figures[name] for name in offer.errors},
    )


def _bought(scene: Scenario, budget: float | None, kept: Kept) -> tuple[Offer, str]:
    """What a budget buys, or the first of `ASKED` that is granted; the probes are run once."""
    if budget is not None:
        return buy(scene, budget=budget, kept=kept), f"{budget:g} s"
    refusal: PurchaseError | None = None
    for asked in ASKED:
        try:
            return buy(scene, accuracy=asked, kept=kept), f"{asked:.0%}"
        except PurchaseError as error:
            refusal = error
    assert refusal is not None
    raise refusal
