"""The command line: `python -m analytic predict | compare | calibrate | field | design | sweep`.

Exit codes: 0 done, 2 the input cannot be used (one sentence says why, on the standard error stream).
"""

from __future__ import annotations

import sys
from pathlib import Path

import typer

from analytic.cli.calibrate import calibrate
from analytic.cli.compare import compare
from analytic.cli.design import design
from analytic.cli.field import field
from analytic.cli.predict import predict
from analytic.cli.sweep import sweep
from analytic.command_line import CommandLine, add_version

app = typer.Typer(
    cls=CommandLine,
    help="Closed-form impact of a debris flow on a rigid barrier which may slide: answers in microseconds.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
add_version(app)
FLOW = (
    "--flow-mass 81000 --barrier-mass 81000 --flow-length 15 --flow-height 3 --speed 10 --base-friction 0.29 "
    "--lambda 0.41 --tau 0.35"
)
app.command(epilog=f"Example: python -m analytic predict {FLOW} --plot impact.png")(predict)
app.command(epilog="Example: python -m analytic compare runs/set_i runs/set_iib --plot fig_14.png")(compare)
app.command(epilog="Example: python -m analytic calibrate runs/case_1 runs/case_1_fixed --plot fig_10.png")(calibrate)
app.command(epilog="Example: python -m analytic field events.csv --plot fig_15.png")(field)
app.command(
    epilog="Example: python -m analytic design --density 1800 --flow-length 15 --flow-height 3 --speed 10 "
    '--base-friction 0.29 --limit 1 --plot chart.png; uncertain: --speed "lognormal(10, 0.2)" --barrier-mass 95000'
)(design)
app.add_typer(sweep, name="sweep")


def main() -> None:
    """Entry point of `python -m analytic` and of the installed command `warp-mpm-analytic`."""
    app(prog_name="warp-mpm-analytic" if Path(sys.argv[0]).name.startswith("warp-mpm") else "python -m analytic")
