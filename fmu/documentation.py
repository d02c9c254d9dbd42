"""What an archive holds beside the unit: a page for its user, licences, icon and reference results."""

from __future__ import annotations

import html
from importlib import metadata
from pathlib import Path

from . import reference
from .units.interface import Interface, Variable

_ASSETS = Path(__file__).parent / "assets"
_ROOT = Path(__file__).parent.parent
_PACKED_BY_PYTHONFMU = """\
<h2>When to take the unit in C</h2>
<p><code>{name}C</code> (FMI 2.0) and <code>{name}C3</code> (FMI 3.0) are the same model in plain C, with the same
variables and the same numbers. Prefer them: they bring no Python into the importer's process and work from any folder.
Take this one to read or change the model in Python{further}. It needs a Python &ge; 3.10 in the importer's process, a
folder without characters that URLs encode (accented letters, <code>#</code>, <code>+</code>, <code>%</code>, brackets),
and on Linux glibc 2.32.</p>
"""
_STYLE = (
    "body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#1d2327}"
    "table{border-collapse:collapse;width:100%;font-size:.9rem}"
    "th,td{text-align:left;padding:.3rem .6rem;border-bottom:1px solid #d5d9dd;vertical-align:top}"
    "code{background:#f1f3f5;padding:0 .2rem}.formula{margin:.6rem 2rem}"
)


def entries(interface: Interface, version: str, *, packer: str = "pythonfmu") -> dict[str, bytes]:
    """Documentation page, licences, icon and reference results of a unit, by their names in the archive."""
    found = {
        "documentation/index.html": page(interface, version, packer=packer).encode(),
        "documentation/licenses/license.txt": _own_licence(),
        "model.png": (_ASSETS / "icon.png").read_bytes(),
    }
    if packer == "pythonfmu":
        found["documentation/licenses/pythonfmu.txt"] = _licence_of("pythonfmu")
    return found | {f"documentation/{name}": data for name, data in reference.files(interface).items()}


def page(interface: Interface, version: str, *, packer: str) -> str:
    """The documentation page: what the unit is, its equations and limits, and its table of variables."""
    body = (_ASSETS / f"{reference.base_of(interface.name)}.html").read_text(encoding="utf-8")
    if packer == "pythonfmu":
        further = ", or to run the simulator on Windows" if interface.name == "DebrisFlow" else ""
        body += _PACKED_BY_PYTHONFMU.format(name=interface.name, further=further)
    tables = "".join(
        _table(heading, interface.of(causality))
        for heading, causality in (("Parameters", "parameter"), ("Inputs", "input"), ("Outputs", "output"))
    )
    title = html.escape(f"{interface.name} {version}")
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{_STYLE}</style></head>\n<body>\n<h1>{title}</h1>\n<p>{html.escape(interface.description)}.</p>\n"
        f"{body}\n{tables}</body></html>\n"
    )


def _table(heading: str, variables: tuple[Variable, ...]) -> str:
    rows = "".join(
        f"<tr><td><code>{v.name}</code></td><td>{html.escape(_unit(v))}</td><td>{html.escape(_start(v))}</td>"
        f"<td>{html.escape(_range(v))}</td><td>{html.escape(v.description)}</td></tr>\n"
        for v in variables
    )
    head = "<tr><th>Name</th><th>Unit</th><th>Start</th><th>Range</th><th>Meaning</th></tr>\n"
    return f"<h2>{heading}</h2>\n<table>{head}{rows}</table>\n"


def _unit(variable: Variable) -> str:
    return variable.unit.name if variable.kind == "Real" else variable.kind


def _start(variable: Variable) -> str:
    if variable.start is None:
        return ""
    if variable.choice:
        return variable.choice.name_of(int(variable.start))
    return f"{variable.start:g}" if variable.kind == "Real" else str(variable.start).lower()


def _range(variable: Variable) -> str:
    bounded = variable.minimum is not None or variable.maximum is not None
    return variable.range_text if variable.choice or bounded else ""


def _own_licence() -> bytes:
    checkout = _ROOT / "LICENSE"
    return checkout.read_bytes() if checkout.is_file() else _licence_of("warp-mpm-impact")


def _licence_of(distribution: str) -> bytes:
    """Licence text of an installed distribution, as its wheel carries it."""
    for path in metadata.files(distribution) or ():
        if path.name.upper().startswith("LICENSE"):
            return Path(str(path.locate())).read_bytes()
    raise FileNotFoundError(f"The installed {distribution} carries no licence text.")
