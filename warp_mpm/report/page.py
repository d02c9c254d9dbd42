"""The page itself: template, style and scripts from `assets/`, filled with the runs' content."""

from __future__ import annotations

import contextlib
import html
import io
import json
import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from string import Template
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from analytic.whole_file import whole_file
from warp_mpm import plotting
from warp_mpm.recording.run_folder import finite
from warp_mpm.report.content import run_content
from warp_mpm.report.points import packed
from warp_mpm.results import Results, ResultsError

POINT_BUDGET = 10_000_000
"""Most bytes of point data of all runs together before compression, which makes at most 13.4 MB of text."""

ASSETS = Path(__file__).parent / "assets"
COLOURS = {"sequential": "viridis", "signed": "RdBu_r"}


def write_report(runs: Sequence[Results], target: str | Path, *, times: Sequence[float] | None = None) -> None:
    """Write the page of one run, or of several side by side, whole or not at all.

    Args:
        runs: at least one.
        target: the HTML file; one that is there is replaced.
        times: [s] of the still pictures, see `plotting.still_times`; those after the end of all runs are left out.

    Raises:
        ResultsError: a run cannot be read, has no snapshot, or all times lie after the end.
        UnwrittenError: the file cannot be written.
    """
    names = _distinct_names(runs)
    stills = plotting.still_times(runs, times)
    contents, blobs = [], []
    for results, name in zip(runs, names, strict=True):
        with results.snapshots:
            content = run_content(results, name)
            content["points"], blob = packed(results, POINT_BUDGET // len(runs), stills)
        content["scene"] = _svg(plotting.scene(results.scenario))
        if results.scenario.output.loads_by_height:
            with contextlib.suppress(ResultsError):  # a run that ended before its second sample has none
                content["loads"] = _svg(plotting.loads_by_height(results))
        contents.append(content)
        blobs.append(blob)
    title = contents[0]["title"] if len(runs) == 1 else " · ".join(names)
    data = {
        "runs": contents,
        "times": stills,
        "colours": {kind: palette(name) for kind, name in COLOURS.items()},
    }
    page = Template((ASSETS / "page.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(title),
        style=(ASSETS / "style.css").read_text(encoding="utf-8"),
        data=embedded(data),
        points="\n".join(
            f'<script type="application/octet-stream" id="points-{index}">{blob}</script>'
            for index, blob in enumerate(blobs)
        ),
        script="\n".join((ASSETS / name).read_text(encoding="utf-8") for name in ("points.js", "charts.js", "page.js")),
        made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )
    with whole_file(Path(target)) as aside:
        aside.write_text(page, encoding="utf-8")


def _distinct_names(runs: Sequence[Results]) -> list[str]:
    """Folder names, or whole paths where two runs have the same."""
    names = [results.path.resolve().name for results in runs]
    return names if len(set(names)) == len(names) else [str(results.path) for results in runs]


def embedded(data: Any) -> str:
    """JSON that cannot end the script element that it stands in."""
    text = json.dumps(finite(data), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def palette(name: str) -> str:
    """256 colours as one string of hexadecimal digits, six each."""
    colours = matplotlib.colormaps[name](np.linspace(0.0, 1.0, 256))[:, :3]
    return np.rint(255 * colours).astype(np.uint8).tobytes().hex()


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "scene"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=True)
    text = buffer.getvalue()
    return re.sub("<metadata>.*</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
