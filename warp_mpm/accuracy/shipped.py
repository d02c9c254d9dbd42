"""What is shipped of the paper's scenes: their ladders, and what the settings that a ladder shares do to them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from analytic.whole_file import write_whole
from warp_mpm.accuracy.errors import KEY_QUANTITIES, ladder_of, references
from warp_mpm.accuracy.keys import DATA, rules_digest, scenario_fields, scene_key
from warp_mpm.accuracy.offer import Rung
from warp_mpm.accuracy.runner import Result
from warp_mpm.accuracy.study import DEFAULT, Setting
from warp_mpm.scenario import Scenario


@dataclass(frozen=True)
class Known:
    """What was measured of a scene."""

    rungs: list[Rung]
    shared: dict[str, float]
    """Relative change of each key quantity with all refined that the rungs share."""


def shipped_scenes() -> dict[str, Known]:
    """What is known of the paper's scenes by the scene's key; nothing where other rules made the figures."""
    if _data().get("rules") != rules_digest():
        return {}
    return {
        key: Known([Rung(**rung) for rung in one["rungs"]], one["shared"])
        for key, one in _data()["scenes"].items()
        if "shared" in one  # else what the rungs share is not known, and nothing can be promised
    }


@cache
def _data() -> dict[str, Any]:
    file = resources.files("warp_mpm.accuracy") / DATA
    content: dict[str, Any] = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {"scenes": {}}
    return content


def write_data(path: Path, scenes: Sequence[tuple[Scenario, Sequence[Setting]]], results: Mapping[str, Result]) -> None:
    """Write what is known of scenes, as `shipped_scenes` reads it.

    Raises:
        ValueError: fewer than three spacings of a scene came to their end.
    """
    fields = sorted({path for scene, _ in scenes for path in scenario_fields(scene)})
    content = {
        "about": "Written by `python -m warp_mpm accuracy SCENARIO... --data FILE`; times are CPU times [s].",
        "rules": rules_digest(),
        "fields": fields,
    }
    found: dict[str, Any] = {}
    for scene, settings in scenes:
        rungs = [
            rung_of(setting.spacing, results[setting.key])
            for setting in settings
            if setting.knob == DEFAULT and not setting.refined and results[setting.key]["status"] == "finished"
        ]
        if len(rungs) >= 3 and rungs[0].figures:
            refined = [setting for setting in settings if setting.refined]
            known = references(scene, ladder_of(settings), results, refined)
            found[scene_key(scene, frozenset(fields))] = {
                "title": scene.title,
                "shared": {name: float(f"{known.budget.shared(name):.4g}") for name in known.key_names},
                "rungs": [rung.__dict__ for rung in rungs],
            }
    write_whole(path, json.dumps(content | {"scenes": found}, indent=1, ensure_ascii=False) + "\n")


def rung_of(spacing: float, result: Result) -> Rung:
    figures = {name: result["figures"].get(name) for name in KEY_QUANTITIES}
    known = {name: float(f"{value:.7g}") for name, value in figures.items() if value is not None}
    return Rung(spacing, float(f"{result['cpu_time'] + result['recording_time']:.4g}"), known)
