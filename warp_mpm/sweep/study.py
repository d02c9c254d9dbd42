"""A parameter study from Python: fields of a scenario that vary, and a table of what came of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warp_mpm.quantities.figures import FIGURES
from warp_mpm.scenario import Scenario
from warp_mpm.sweep.design import Sweep
from warp_mpm.sweep.engine import run_sweep


def study(
    scenario: Scenario,
    vary: Mapping[str, Sequence[Any] | Mapping[str, Any]],
    folder: str | Path,
    *,
    method: str = "grid",
    samples: int | None = None,
    seed: int = 0,
    workers: int = 2,
    scheduler: str | None = None,
    device: str = "cpu",
    retry_failed: bool = False,
) -> Any:
    """Run a scenario with fields varied, each case in a folder of its own, and return the table as a DataFrame.

    >>> frame = study(scenario, {"flow.velocity_m_per_s.0": [10, 15, 20], "barrier.friction": [0.2, 0.4]}, "runs/study")
    >>> frame.pivot(index="flow.velocity_m_per_s.0", columns="barrier.friction", values="peak_force")

    Called again with the same folder, only what is missing is run. A case that fails is a row and does not stop the
    others. The cases run in processes of their own, so that a script keeps its call below `if __name__ == "__main__":`.

    Args:
        scenario: what is varied.
        vary: by the fields' paths, a list of values, or what a sweep file says of it, `{"uniform": [0.4, 0.55]}`.
        folder: of the study; made if need be. `cases/` holds the run folders.
        method: `grid`, `list`, `latin_hypercube` or `random`, as in a sweep file.
        samples: number of cases of the last two.
        seed: of their random numbers.
        workers: cases at a time.
        scheduler: address of a Dask scheduler whose workers run the cases; None runs them here, without Dask.
        device: of the simulations.
        retry_failed: cases that failed before are run again.

    Returns:
        One row for each case, indexed by `case`: the varied fields, `status`, `problem` and the key figures (SI).
        `frame.attrs["units"]` has the figures' units, `frame.attrs["meanings"]` how they are taken.

    Raises:
        SweepError: a field cannot take a value, the folder holds another study, or pandas is not installed; nothing was
            run.
    """
    varied = {
        path: dict(what) if isinstance(what, Mapping) else {"values": _plain(what)} for path, what in vary.items()
    }
    content = {"title": scenario.title, "scenario": "", "method": method, "vary": varied, "seed": seed}
    plan = Sweep.checked(content | ({} if samples is None else {"samples": samples}), "study")
    rows = run_sweep(
        plan,
        scenario,
        folder,
        workers=workers,
        scheduler=scheduler,
        on_dask=scheduler is not None,
        device=device,
        retry_failed=retry_failed,
    )
    import pandas as pd

    frame = pd.DataFrame(rows).set_index("case")
    frame.attrs["units"] = {name: FIGURES[name].unit for name in frame.columns if name in FIGURES}
    frame.attrs["meanings"] = {name: FIGURES[name].meaning for name in frame.columns if name in FIGURES}
    return frame


def _plain(values: Sequence[Any]) -> list[Any]:
    """Without the types of numpy, which JSON does not have."""
    return [value.tolist() if hasattr(value, "tolist") else value for value in values]
