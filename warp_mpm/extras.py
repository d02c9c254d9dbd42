"""What to install where a feature lacks an optional package."""

from __future__ import annotations

import re
from importlib import metadata

from analytic.version import PROJECT


def install(extra: str) -> str:
    """The command that installs the packages of an extra of this project, in a checkout and beside a wheel alike.

    The project itself is on no package index, so its extras cannot be asked for by its name.
    """
    try:
        required = metadata.requires(PROJECT) or []
    except metadata.PackageNotFoundError:  # a bare checkout
        required = []
    marker = re.compile(rf"""\s*;\s*extra\s*==\s*["']{extra}["']$""")
    packages = [marker.sub("", line) for line in required if marker.search(line)]
    if not packages:  # a checkout that was installed before it had this extra
        return f"pip install '.[{extra}]' in the project's folder"
    return "pip install " + " ".join(f'"{package}"' for package in packages)


def missing(what: str, packages: str, extra: str) -> str:
    """The sentence for a feature that lacks packages."""
    return f"{what} needs {packages}: {install(extra)}"
