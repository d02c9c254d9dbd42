"""`python -m fmu` in a checkout; installed, `python -m warp_mpm_fmu` and the command `warp-mpm-fmu`."""

import sys
from pathlib import Path


def main() -> None:
    """Run the command line."""
    try:
        from . import cli

        cli.main()
    except KeyboardInterrupt:  # while the command line itself is loaded
        sys.exit(130)


if __name__ == "__main__":
    # Python has put the working folder first, where a user's own file would stand in for another of our packages.
    if Path(sys.path[0]) == Path.cwd() != Path(__file__).resolve().parents[1]:
        sys.path.append(sys.path.pop(0))
    main()
