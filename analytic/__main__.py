"""`python -m analytic`, and the installed command `warp-mpm-analytic`."""

import sys


def main() -> None:
    """Run the command line."""
    try:
        from analytic import cli

        cli.main()
    except KeyboardInterrupt:  # while the command line itself is loaded
        sys.exit(130)


if __name__ == "__main__":
    main()
