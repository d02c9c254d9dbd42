"""What pyproject.toml cannot say: which folders are packed by other names than their own.

The folder `scenarios/` is packed as `warp_mpm/scenarios`, so that an installed wheel has the scenes too;
`warp_mpm/shipped.py` finds them in either place. The folder `fmu/` is packed as `warp_mpm_fmu`, for a package `fmu` of
others is on PyPI, whose files it would overwrite. Its modules import each other relatively, so both names do.
"""

from setuptools import find_namespace_packages, setup

FMU = "warp_mpm_fmu"

setup(
    packages=[
        *find_namespace_packages(include=["warp_mpm*", "analytic*"]),
        *(FMU + name.removeprefix("fmu") for name in find_namespace_packages(include=["fmu", "fmu.*"])),
        "warp_mpm.scenarios",
    ],
    package_dir={"warp_mpm.scenarios": "scenarios", FMU: "fmu"},
    # A build takes all that lies in its folder: what earlier ones left in build/lib had `fmu` in it.
    options={"build": {"build_base": "build/wheel"}},
)
