"""The page itself: template, style and scripts from `assets/`, filled with the runs' content."""

from __future__ import annotations

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

from warp_mpm import plotting
from warp_mpm.recording.run_folder import finite
from warp_mpm.report.content import run_content
from warp_mpm.report.points import packed
from warp_mpm.results import Results, ResultsError

DEFAULT_TIMES = (1.0, 2.0, 4.0)
"""Times [s] of the still pictures, those of the paper's Figs. 4 to 6."""

POINT_BUDGET = 10_000_000
"""Most bytes of point data of all runs together before compression, which makes at most 13.4 MB of text."""

ASSETS = Path(__file__).parent / "assets"
COLOURS = {"sequential": "viridis", "signed": "RdBu_r"}


def write_report(runs: Sequence[Results], target: Path, *, times: Sequence[float] = DEFAULT_TIMES) -> None:
    """Write the page of one run, or of several side by side, whole or not at all.

    Args:
        runs: at least one.
        target: the HTML file; one that is there is replaced.
        times: [s] of the still pictures; those after the end of a run are left out, if all are, its last one is shown.

    Raises:
        ResultsError: a run cannot be read, or has no snapshot.
        OSError: the file cannot be written.
    """
    names = _distinct_names(runs)
    contents, blobs = [], []
    for results, name in zip(runs, names, strict=True):
        with results.snapshots as snapshots:
            if len(snapshots) == 0:
                raise ResultsError(f"{results.path} holds no snapshot, so there is nothing to show yet.")
            content = run_content(results, name)
            content["points"], blob = packed(results, POINT_BUDGET // len(runs), times)
        content["scene"] = _svg(plotting.scene(results.scenario))
        contents.append(content)
        blobs.append(blob)
    title = contents[0]["title"] if len(runs) == 1 else " · ".join(names)
    data = {
        "runs": contents,
        "times": _still_times(times, contents),
        "colours": {kind: _palette(name) for kind, name in COLOURS.items()},
    }
    page = Template((ASSETS / "page.html").read_text(encoding="utf-8")).substitute(
        title=html.escape(title),
        style=(ASSETS / "style.css").read_text(encoding="utf-8"),
        data=_embedded(data),
        points="\n".join(
            f'<script type="application/octet-stream" id="points-{index}">{blob}</script>'
            for index, blob in enumerate(blobs)
        ),
        script="\n".join((ASSETS / name).read_text(encoding="utf-8") for name in ("points.js", "charts.js", "page.js")),
        made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )
    aside = target.with_name(target.name + ".new")
    try:
        aside.write_text(page, encoding="utf-8")
        aside.replace(target)
    except OSError:
        aside.unlink(missing_ok=True)
        raise


def _distinct_names(runs: Sequence[Results]) -> list[str]:
    """Folder names, or whole paths where two runs have the same."""
    names = [results.path.resolve().name for results in runs]
    return names if len(set(names)) == len(names) else [str(results.path) for results in runs]


def _still_times(times: Sequence[float], contents: Sequence[dict[str, Any]]) -> list[float]:
    end = max(content["points"]["times"][-1] for content in contents)
    return [time for time in times if time <= end + 1e-9] or [end]


def _embedded(data: Any) -> str:
    """JSON that cannot end the script element that it stands in."""
    text = json.dumps(finite(data), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _palette(name: str) -> str:
    """256 colours as one string of hexadecimal digits, six each."""
    colours = matplotlib.colormaps[name](np.linspace(0.0, 1.0, 256))[:, :3]
    return np.rint(255 * colours).astype(np.uint8).tobytes().hex()


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "scene"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=True)
    text = buffer.getvalue()
    return re.sub("<metadata>.*</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
