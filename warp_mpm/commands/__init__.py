"""Commands beside `run`, `check` and `schema`: on shipped scenes, on finished runs, and on many at once."""

from __future__ import annotations

from collections.abc import Callable

import typer

from warp_mpm.commands.accuracy import accuracy
from warp_mpm.commands.animate import animate
from warp_mpm.commands.benchmark import benchmark
from warp_mpm.commands.design import design
from warp_mpm.commands.export import export
from warp_mpm.commands.hard_cases import hard_cases
from warp_mpm.commands.init import init
from warp_mpm.commands.plan import plan
from warp_mpm.commands.plot import plot
from warp_mpm.commands.quantities import quantities
from warp_mpm.commands.report import report
from warp_mpm.commands.scenarios import scenarios
from warp_mpm.commands.sweep import sweep
from warp_mpm.commands.uncertainty import uncertainty
from warp_mpm.commands.validate import validate

EXAMPLES: dict[Callable[..., None], str] = {
    scenarios: "Example: python -m warp_mpm scenarios; all of them: python -m warp_mpm scenarios --out scenarios",
    init: (
        "Example: python -m warp_mpm init site.json --depth 2.2 --length 11 --bulk-density 1.9t/m3 --speed 12 "
        '--slope 8 --height 5 --crest 4 --limit "displacement <= 0.5 m"'
    ),
    quantities: "Example: python -m warp_mpm quantities scenarios/case_1.json",
    report: (
        "Example: python -m warp_mpm report runs/set_iib; "
        "two side by side: python -m warp_mpm report runs/case_1 runs/case_1_fixed --out comparison.html"
    ),
    plot: (
        "Example: python -m warp_mpm plot field runs/case_1 runs/case_4 --times 1,2,4,6 --out fig_5.png; "
        "a scenario before it runs: python -m warp_mpm plot scene scenarios/set_iib.json"
    ),
    animate: "Example: python -m warp_mpm animate runs/set_iib --out set_iib.mp4 --field pore_pressure --speed 0.5",
    export: "Example: python -m warp_mpm export runs/set_iib --vtu",
    sweep: "Example: python -m warp_mpm sweep scenarios/sweeps/barrier_mass.json --out runs/barrier_mass --workers 2",
    design: (
        'Example: python -m warp_mpm design scenarios/case_1.json --limit "displacement <= 1 m" '
        "--vary barrier.shape.crest_width_m=1:8 --vary barrier.shape.height_m=4:8 --until 4"
    ),
    uncertainty: (
        'Example: python -m warp_mpm uncertainty scenarios/case_1.json --limit "displacement <= 2 m" '
        '--vary "flow.velocity_m_per_s.0=lognormal(10, 0.15)" --vary "barrier.motion.base_friction=normal(0.29, 0.03)" '
        "--until 4"
    ),
    accuracy: "Example: python -m warp_mpm accuracy scenarios/case_1.json --quick",
    hard_cases: "Example: python -m warp_mpm hard-cases --quick --only one_point --only face_90",
    plan: "Example: python -m warp_mpm plan scenarios/case_1.json --what-if",
    benchmark: "Example: python -m warp_mpm benchmark speed --out docs/performance",
    validate: "Example: python -m warp_mpm validate --quick; one case: python -m warp_mpm validate --only terzaghi",
}


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    for command, example in EXAMPLES.items():
        app.command(epilog=example)(command)
