"""Pressure on the impacted face over height and time, and the envelope of both."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from analytic.force_record import moving_mean
from warp_mpm.plotting.style import BLUE, EDGE, GREEN, ORANGE, grid, heading
from warp_mpm.quantities.figures import FIGURES
from warp_mpm.quantities.time_series import NAMED
from warp_mpm.results import Results, ResultsError

COLUMNS = 1500
"""Times that the picture resolves."""


def loads_by_height(results: Results) -> Figure:
    """Normal pressure on the impacted face: height over time, coloured by pressure, with the height of the resultant;
    and beside it the envelope, what each height met at most. Pressures are means over the patch of
    `pressure_patch_max`: from one slot to the next they scatter by what the grid cannot tell.

    Raises:
        ResultsError: the run has no loads by height, or no samples of them.
    """
    loads, series, output = results.loads, results.time_series, results.scenario.output
    if len(loads.times) < 2:
        raise ResultsError(f"{results.path} has no loads by height to draw: the run ended before its second sample.")
    face, pressure = loads.surfaces["impact"], NAMED["pressure_patch"]
    # On a face with steps or a lip a height is no place: the way along it is.
    upward = bool((np.diff(face.height) > 0.0).all())
    time, height = loads.times, face.height if upward else face.edges
    top = _reached(face.pressures["normal"], height)
    shares = patches(face.edges, output.pressure_patch_m)
    means = {
        name: np.array([moving_mean(time, column, output.pressure_patch_s) for column in (values @ shares).T]).T
        * pressure.factor
        for name, values in face.pressures.items()
        if name in ("normal", "pore_pressure")
    }

    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    heading(figure, results.scenario.title)
    over_time, envelope = figure.subplots(1, 2, sharey=True, width_ratios=(2.6, 1.0))
    bunch = max(1, -(-(len(time) - 1) // COLUMNS))
    # Of a bunch of samples the greatest, so that no peak is lost.
    rows = np.maximum.reduceat(means["normal"][1:], np.arange(0, len(time) - 1, bunch))
    edges = np.append(time[:-1][::bunch], time[-1])
    image = over_time.pcolormesh(edges, height, rows.T, cmap="viridis", vmin=0.0, rasterized=True)
    words = f"mean over {output.pressure_patch_m:g} m and {output.pressure_patch_s:g} s"
    figure.colorbar(image, ax=over_time, label=f"normal pressure [{pressure.shown_unit}],\n{words}", pad=0.01)
    if upward and "impact_force_height" in series and "impact_force_x" in series:
        force = moving_mean(series["time"], series["impact_force_x"])
        moment = moving_mean(series["time"], series["impact_force_x"] * series["impact_force_height"])
        pressed = force > 0.02 * max(float(force.max()), 1e-300)
        acting = np.where(pressed, moment / np.where(pressed, force, 1.0), np.nan)
        over_time.plot(series["time"], acting, color="white", linewidth=2.4)
        over_time.plot(series["time"], acting, color=EDGE, linewidth=1.2, label="height of the resultant")
        over_time.legend(fontsize=8, loc="upper right")
    over_time.set(
        xlabel="time [s]", ylabel=f"{'height' if upward else 'way'} on the face [m]", ylim=(float(height[0]), top)
    )

    for name, values in means.items():
        colour, words = (BLUE, "both phases") if name == "normal" else (ORANGE, "pore pressure")
        envelope.stairs(values.max(axis=0), height, orientation="horizontal", baseline=None, color=colour, label=words)
    acts = results.summary.get("peak_force_height")
    if acts is not None and upward:
        envelope.axhline(acts, color=GREEN, linewidth=1.2, linestyle="--", label=FIGURES["peak_force_height"].words)
    envelope.set(xlabel=f"greatest pressure [{pressure.shown_unit}]", xlim=(0.0, None))
    envelope.legend(fontsize=8)
    grid(envelope)
    return figure


def patches(edges: np.ndarray, length: float) -> np.ndarray:
    """Shares [n, n] of the slots (first axis) in the mean over a patch around each of them; at the ends of the face
    over what there is of it.

    Args:
        edges: [n + 1] of the slots [m].
        length: of the patch [m]; at least one slot.
    """
    middle, slot = 0.5 * (edges[1:] + edges[:-1]), float(edges[1] - edges[0])
    low = np.maximum(middle - 0.5 * max(length, slot), edges[0])
    high = np.minimum(middle + 0.5 * max(length, slot), edges[-1])
    overlap = np.minimum(edges[1:, None], high) - np.maximum(edges[:-1, None], low)
    return np.maximum(overlap, 0.0) / (high - low)


def _reached(normal: np.ndarray, height: np.ndarray) -> float:
    """Height [m] that the picture shows: all that was pressed, and a little more."""
    pressed = np.flatnonzero((normal > 0.0).any(axis=0))
    last = float(height[pressed[-1] + 1]) if pressed.size else float(height[-1])
    return min(float(height[0]) + 1.1 * (last - float(height[0])), float(height[-1]))
