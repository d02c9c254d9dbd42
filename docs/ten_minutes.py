"""Type `ten_minutes.md` as a new user does: the wheel, a fresh environment, every command as printed; with times.

python docs/ten_minutes.py --out /tmp/ten_minutes --pictures docs/images/ten_minutes

What Warp compiled before is not used, so that the first run compiles as on a new machine. Pictures of the PDF's pages
need pypdfium2 and Pillow.
"""

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).with_suffix(".md")
ROOT = PAGE.parents[1]
PICTURED = 3
"""Pages of the PDF that the page shows."""
SCALE = 1.1
"""Pixels of a picture for each point of the PDF."""


def commands(page: Path = PAGE) -> list[str]:
    """What the page asks to type, in its order."""
    text = page.read_text(encoding="utf-8")
    blocks = re.findall(r"^```(?:bash|console)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return [line for block in blocks for line in block.replace("\\\n", " ").splitlines() if line.strip()]


def typed(lines: list[str], folder: Path) -> list[tuple[str, float, float]]:
    """Each command with its wall time and processor time [s], all typed into one shell.

    Raises:
        SystemExit: one fails.
    """
    script = ["set -e", "TIMEFORMAT='%R %U %S'"]
    script += [f"{{ time {{ {line}\n}} >> said 2>&1; }} 2>> times" for line in lines]
    environment = {**os.environ, "WARP_CACHE_PATH": str(folder / "warp"), "MPLBACKEND": "agg"}
    for name in ("PYTHONPATH", "VIRTUAL_ENV"):
        environment.pop(name, None)
    done = subprocess.run(["bash", "-c", "\n".join(script)], cwd=folder, env=environment, check=False)
    times = [tuple(map(float, line.split())) for line in (folder / "times").read_text().splitlines()]
    if done.returncode:
        sys.exit(f"{lines[min(len(times), len(lines) - 1)]}\nfailed:\n{(folder / 'said').read_text()[-3000:]}")
    return [(line, wall, user + system) for line, (wall, user, system) in zip(lines, times, strict=True)]


def pictures(pdf: Path, folder: Path) -> None:
    """The first pages of the PDF as PNG."""
    import pypdfium2

    folder.mkdir(parents=True, exist_ok=True)
    for number, page in enumerate(list(pypdfium2.PdfDocument(pdf))[:PICTURED], start=1):
        picture = page.render(scale=SCALE).to_pil().convert("P", palette=1, colors=128)
        picture.save(folder / f"page_{number}.png", optimize=True)


def main() -> None:
    """Type the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True, help="a folder to make")
    parser.add_argument("--pictures", type=Path, help="folder for pictures of the PDF's pages")
    options = parser.parse_args()
    options.out.mkdir(parents=True)
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", options.out, ROOT], check=True
    )
    timed = typed(commands(), options.out)
    for line, wall, processor in timed:
        print(f"{wall:7.1f} s {processor:7.1f} s  {line}")
    print(f"{sum(one[1] for one in timed):7.1f} s {sum(one[2] for one in timed):7.1f} s  in all (wall, processor)")
    if options.pictures is not None:
        pictures(options.out / "runs/valley/report.pdf", options.pictures)


if __name__ == "__main__":
    main()
