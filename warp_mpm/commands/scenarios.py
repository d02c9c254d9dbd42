"""`python -m warp_mpm scenarios`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from analytic.command_line import refusals
from analytic.whole_file import whole_file


def scenarios(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME", help="Scenes: case_1, hard/speed_50, ...", show_default="all"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Copy them into this folder.", show_default=False)
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files there that differ.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print names, titles and files as JSON.")] = False,
) -> None:
    """List the scenes that come with the program, or copy them.

    These are the paper's scenes, sites (site_...), in hard/ those that were chosen to break the code, and in sweeps/
    examples of sweeps. Copied into a folder `scenarios`, they are where the examples of the help texts and of the pages
    look for them; a table that one of them names is copied too.
    """
    from warp_mpm.shipped import SCENARIOS, scenario_files
    from warp_mpm.tables_beside import tables_beside

    with refusals():
        known = scenario_files()
        if not known:
            raise ValueError(f"{SCENARIOS} holds no scenes; install this program again.")
        chosen = list(dict.fromkeys(name.removesuffix(".json").removeprefix("scenarios/") for name in names or known))
        for name in chosen:
            if name not in known:
                raise ValueError(
                    f"There is no scene {name!r}; python -m warp_mpm scenarios lists the {len(known)} there are."
                )
        contents = {name: json.loads(known[name].read_text(encoding="utf-8")) for name in chosen}
        if out is not None:
            files = [known[name] for name in chosen]
            files += [table for name in chosen for table in tables_beside(contents[name], known[name].parent)]
            copied, same = _copy({file.relative_to(SCENARIOS): file for file in files}, out, force=force)
            as_they_are = f"; {same} {'was' if same == 1 else 'were'} there already" if same else ""
            typer.echo(f"Copied into {out}: {copied} {'file' if copied == 1 else 'files'}{as_they_are}.", err=True)
    titles = {name: content["title"] for name, content in contents.items()}
    if as_json:
        rows = [{"name": name, "title": titles[name], "file": str(_place(out, name) or known[name])} for name in chosen]
        typer.echo(json.dumps(rows, indent=2, ensure_ascii=False))
    elif out is None:
        width = max(map(len, chosen))
        typer.echo("\n".join(f"{name:{width}}  {titles[name]}" for name in chosen))


def _place(folder: Path | None, name: str) -> Path | None:
    return folder / f"{name}.json" if folder is not None else None


def _copy(files: dict[Path, Path], folder: Path, *, force: bool) -> tuple[int, int]:
    """Copy files into a folder by their places there; how many were copied, and how many were there as they are.

    Raises:
        ValueError: another file of a name is there; nothing has been written then.
        OSError: the folder cannot be made, or a file not be written.
    """
    wanted = {folder / place: file.read_bytes() for place, file in files.items()}
    new = {target: text for target, text in wanted.items() if not target.exists() or target.read_bytes() != text}
    for target in new:
        if target.exists() and not force:
            raise ValueError(f"{target} is there already and differs; --force replaces it.")
    for target, text in new.items():
        target.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(target) as aside:
            aside.write_bytes(text)
    return len(new), len(wanted) - len(new)
