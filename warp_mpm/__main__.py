"""`python -m warp_mpm`."""

from warp_mpm.cli import main

if __name__ == "__main__":
    main()
