"""What pyproject.toml cannot say: the folder `scenarios/` is packed as `warp_mpm/scenarios`, so that an installed wheel
has the scenes too. `warp_mpm/shipped.py` finds them in either place.
"""

from setuptools import find_namespace_packages, setup

setup(
    packages=[*find_namespace_packages(include=["warp_mpm*", "analytic*", "fmu*"]), "warp_mpm.scenarios"],
    package_dir={"warp_mpm.scenarios": "scenarios"},
)
