"""Which version of the project this is, and of what it computes with."""

from __future__ import annotations

import platform
from importlib import metadata
from pathlib import Path

PROJECT = "warp-mpm-impact"
_PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"


def project_version() -> str:
    """Version of the project: in a checkout what its `pyproject.toml` says, else that of the installed package."""
    if _PYPROJECT.is_file():
        import tomllib

        project = tomllib.loads(_PYPROJECT.read_text(encoding="utf-8")).get("project", {})
        if project.get("name") == PROJECT:
            return project["version"]
    return metadata.version(PROJECT)


def versions() -> str:
    """One line for `--version`: the project, Warp and Python."""
    try:
        warp = metadata.version("warp-lang")
    except metadata.PackageNotFoundError:
        warp = "not installed"
    return f"{PROJECT} {project_version()}, Warp {warp}, Python {platform.python_version()}"
