"""Draw every shipped scene, those of the hard cases apart, and write the page `gallery.md` of the pictures.

python docs/gallery.py
"""

from __future__ import annotations

from pathlib import Path

from warp_mpm import plotting
from warp_mpm.description import described
from warp_mpm.scenario import Scenario
from warp_mpm.shipped import scenario_files

PAGE = Path(__file__).with_suffix(".md")
PICTURES = PAGE.parent / "images/gallery"
RESOLUTION = 60
"""Of the pictures [dots per inch]."""

HEAD = """# Gallery

Every scene that comes with the program, as it is before it begins: `python docs/gallery.py` draws them.
`warp-mpm scenarios --out scenarios` puts the files into the folder you are in, `python -m warp_mpm run
scenarios/NAME.json` runs one. Those that were chosen to break the code are on the page of [hard cases](robustness.md),
with the end of each.
"""


def shown() -> dict[str, Path]:
    """Names and files of the scenes of the page."""
    return {name: file for name, file in scenario_files().items() if "/" not in name}


def entry(name: str, scenario: Scenario) -> str:
    """What the page says of a scene."""
    return (
        f"\n## {name}\n\n{scenario.title}. {described(scenario)[0][0].upper()}{described(scenario)[0][1:]}.\n\n"
        f"![{scenario.title}](images/gallery/{name}.png)\n"
    )


def main() -> None:
    """Draw, and write the page."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    page = [HEAD]
    for name, file in shown().items():
        scenario = Scenario.load(file)
        plotting.scene(scenario).savefig(PICTURES / f"{name}.png", dpi=RESOLUTION)
        page.append(entry(name, scenario))
    PAGE.write_text("".join(page), encoding="utf-8")


if __name__ == "__main__":
    main()
