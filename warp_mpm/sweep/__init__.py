"""Sweeps: one scenario, some of its fields varied, many runs, one table."""

from warp_mpm.sweep.design import Case as Case
from warp_mpm.sweep.design import Sweep as Sweep
from warp_mpm.sweep.design import SweepError as SweepError
from warp_mpm.sweep.engine import run_sweep as run_sweep
from warp_mpm.sweep.study import study as study

__all__ = ["Case", "Sweep", "SweepError", "run_sweep", "study"]
