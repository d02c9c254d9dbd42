"""Known answers: the simulator against closed-form solutions, against the paper, and against itself as it is refined.

`python -m warp_mpm validate` runs the cases of `catalogue.py` and writes a page of them.
"""
