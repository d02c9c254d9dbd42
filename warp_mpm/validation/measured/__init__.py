"""Cases held against measurements: `python -m warp_mpm validate --measured`."""
