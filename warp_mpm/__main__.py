"""`python -m warp_mpm`, and the installed command `warp-mpm`."""

import sys
from pathlib import Path


def main() -> None:
    """Run the command line."""
    try:
        from warp_mpm import cli

        cli.main()
    except KeyboardInterrupt:  # while the command line itself is loaded
        sys.exit(130)


if __name__ == "__main__":
    # Python has put the working folder first, where a user's own analytic.py would stand in for our package.
    if Path(sys.path[0]) == Path.cwd() != Path(__file__).resolve().parents[1]:
        sys.path.append(sys.path.pop(0))
    main()
