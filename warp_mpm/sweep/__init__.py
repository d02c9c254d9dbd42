"""Sweeps: one scenario, some of its fields varied, many runs on Dask, one table."""

from warp_mpm.sweep.design import Case as Case
from warp_mpm.sweep.design import Sweep as Sweep
from warp_mpm.sweep.design import SweepError as SweepError
from warp_mpm.sweep.engine import run_sweep as run_sweep

__all__ = ["Case", "Sweep", "SweepError", "run_sweep"]
