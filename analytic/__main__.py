"""`python -m analytic`."""

from analytic.cli import main

if __name__ == "__main__":
    main()
