"""`python -m fmu`, and the installed command `warp-mpm-fmu`."""

import sys


def main() -> None:
    """Run the command line."""
    try:
        from fmu import cli

        cli.main()
    except KeyboardInterrupt:  # while the command line itself is loaded
        sys.exit(130)


if __name__ == "__main__":
    main()
