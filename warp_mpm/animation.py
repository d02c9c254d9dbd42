"""Films of a run: one picture for each snapshot."""

from __future__ import annotations

import errno
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from analytic.force_record import FILTER_WINDOW, moving_mean
from analytic.whole_file import whole_file
from warp_mpm.extras import missing
from warp_mpm.fields import colour_limits, field_named
from warp_mpm.plotting.points import Window, draw_points, draw_surroundings, in_lines, shown, window
from warp_mpm.plotting.style import BLUE, GREY, ORANGE, PlotError, check_path, grid, heading, symbol
from warp_mpm.quantities.points import Drawn
from warp_mpm.quantities.time_series import NAMED
from warp_mpm.results import Results, ResultsError

FORMATS = ("mp4", "gif")
SLOWEST, FASTEST = 2.0, 50.0
"""Least and most pictures per second; a gif player knows no shorter time than 20 ms."""


def write_film(
    results: Results,
    target: Path,
    *,
    field_name: str = "",
    speed: float = 0.5,
    width: int = 1280,
    watch: Callable[[Sequence[int]], Iterable[int]] = lambda frames: frames,
) -> None:
    """Write the film of a run, whole or not at all.

    Args:
        results: of the run.
        target: an mp4 or gif file; one that is there is replaced.
        field_name: colours the points, see `warp_mpm.fields`; empty: pore pressure, or the speed of a dry flow.
        speed: simulated seconds per second of the film.
        width: of the picture [pixels].
        watch: wraps the numbers of the snapshots as they are drawn, for instance to show progress.

    Raises:
        PlotError: the file's format is unknown, its folder does not exist, or what writes mp4 is not installed.
        UnwrittenError: the file cannot be written.
        ResultsError: the run cannot be read, holds no two snapshots, or has no such field.
        ValueError: the field is not known.
    """
    check_path(target, FORMATS)
    snapshots = results.snapshots
    if len(snapshots) < 2:
        raise ResultsError(f"{results.path} holds {len(snapshots)} snapshots; a film needs two.")
    field = field_named(field_name or ("pore_pressure" if "pore_pressure" in snapshots.names else "speed"))
    interval = float(np.median(np.diff(snapshots.times)))
    # Snapshots too near or too far from each other for a player: some are left out, or each stays longer.
    stride = max(1, math.ceil(speed / interval / FASTEST))
    rate = max(speed / interval / stride, SLOWEST)
    write = _write_gif if target.suffix.lower() == ".gif" else _write_mp4
    with whole_file(target) as aside:
        write(_pictures(results, field, width, watch(range(0, len(snapshots), stride))), aside, rate)


def _pictures(results: Results, field: Drawn, width: int, frames: Iterable[int]) -> Iterator[np.ndarray]:
    """RGB pictures [height, width, 3] of the snapshots."""
    scenario, snapshots = results.scenario, results.snapshots
    sparse = [snapshots[index] for index in np.unique(np.linspace(0, len(snapshots) - 1, 25).astype(int))]
    limits = colour_limits(np.concatenate([shown(results, frame, field) for frame in sparse]), field.signed)
    view = _film_window(window(scenario, sparse), sparse)
    left, right, bottom, top = view
    curves = "impact_force_x" in results.time_series
    # Letters shrink with the picture, but by less, so that they can be read; what is left of a step is for rounding.
    dpi = 100.0 * math.sqrt(width / 1280)
    wide = (width + 0.1) / dpi
    flow_height = min(max(0.85 * wide * (top - bottom) / (right - left), 1.5), 0.6 * wide)
    height = flow_height + 1.2 + (2.1 if curves else 0.0)
    # Encoders want even numbers of pixels.
    figure = Figure(figsize=(wide, (2 * round(height * dpi / 2) + 0.1) / dpi), dpi=dpi, layout="constrained")
    heading(figure, scenario.title)
    canvas = FigureCanvasAgg(figure)
    panels = figure.subplots(2, 1, height_ratios=[flow_height, 2.1]) if curves else [figure.subplots()]
    marks = _draw_curves(panels[1], results) if curves else []
    bar: Any = None
    for index in frames:
        frame = snapshots[index]
        panels[0].clear()
        drawn = draw_points(panels[0], frame, shown(results, frame, field), field, limits)
        draw_surroundings(panels[0], scenario, frame, view, results.barrier_displacements(frame))
        panels[0].set(xlabel="x [m]", ylabel="y [m]")
        panels[0].set_title(f"t = {frame.time:.2f} s", fontsize=10, loc="left")
        if bar is None:
            label = in_lines(field.title, flow_height)
            bar = figure.colorbar(drawn, ax=panels[0], label=label, extend="both" if field.signed else "max")
        for mark in marks:
            mark.set_xdata([frame.time, frame.time])
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _film_window(whole: Window, frames: Sequence[Any]) -> Window:
    """The window without the last stray points of a jet, but with all of the barrier's way."""
    points = np.concatenate([frame.position for frame in frames])
    _, right, bottom, _ = whole
    far, high = np.quantile(points[:, 0], 0.99), np.quantile(points[:, 1], 0.995)
    barrier = max((frame.barrier_displacement or 0.0) for frame in frames) + 15.0
    return (
        whole[0],
        min(right, max(float(far), barrier)),
        bottom,
        max(float(high) + 0.1 * abs(float(high)), bottom + 4.0),
    )


def _draw_curves(panel: Any, results: Results) -> list[Any]:
    """Force and displacement against time; returns the line that marks the present."""
    series = results.time_series
    time = series["time"]
    force, moved = NAMED["impact_force_x"], NAMED["barrier_displacement"]
    panel.plot(time, moving_mean(time, series[force.name]) * force.factor, color=BLUE)
    panel.set(xlabel="time [s]", xlim=(float(time[0]), float(time[-1])))
    panel.set_ylabel(
        f"impact force {symbol(force)}\n[{force.shown_unit}], {FILTER_WINDOW:g} s mean", color=BLUE, fontsize=9
    )
    grid(panel)
    if np.any(series.get(moved.name, 0.0)):
        other = panel.twinx()
        other.plot(time, series[moved.name] * moved.factor, color=ORANGE, linestyle="--")
        other.set_ylabel(f"barrier\ndisplacement [{moved.shown_unit}]", color=ORANGE, fontsize=9)
        other.set_ylim(bottom=0.0)
    return [panel.axvline(0.0, color=GREY)]


def _write_gif(pictures: Iterator[np.ndarray], target: Path, rate: float) -> None:
    from PIL import Image

    images = (Image.fromarray(picture).quantize(128) for picture in pictures)
    first = next(images)
    first.save(target, "GIF", save_all=True, append_images=images, duration=round(1000 / rate), loop=0, optimize=False)


def _write_mp4(pictures: Iterator[np.ndarray], target: Path, rate: float) -> None:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise PlotError(missing("mp4", "imageio-ffmpeg (a gif needs nothing more)", "animate")) from None
    first = next(pictures)
    writer = imageio_ffmpeg.write_frames(
        str(target),
        (first.shape[1], first.shape[0]),
        fps=rate,
        codec="libx264",
        output_params=["-crf", "20", "-f", "mp4"],
        macro_block_size=2,
    )
    writer.send(None)
    try:
        writer.send(np.ascontiguousarray(first))
        for picture in pictures:
            writer.send(np.ascontiguousarray(picture))
    finally:
        writer.close()
    if not _is_whole_mp4(target):  # the encoder's own exit code is not told
        raise OSError(errno.EIO, "the encoder could not write all of it; the disk may be full")


def _is_whole_mp4(file: Path) -> bool:
    """Whether its boxes (ISO/IEC 14496-12, 4.2) end where the file does, the index among them."""
    names, place, size = set(), 0, file.stat().st_size
    with file.open("rb") as stream:
        while place < size:
            stream.seek(place)
            head = stream.read(16)
            length = int.from_bytes(head[:4], "big")
            if length == 1:
                length = int.from_bytes(head[8:], "big")
            if length < 8:
                return False
            names.add(head[4:8])
            place += length
    return place == size and b"moov" in names
