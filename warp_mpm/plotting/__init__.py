"""Figures of runs. Every axis carries its unit; colour-blind readers can tell the colours (Okabe and Ito's) apart."""

from warp_mpm.plotting.curves import comparison as comparison
from warp_mpm.plotting.curves import force_and_displacement as force_and_displacement
from warp_mpm.plotting.loads import loads_by_height as loads_by_height
from warp_mpm.plotting.mechanism import mechanism_diagram as mechanism_diagram
from warp_mpm.plotting.points import field_panels as field_panels
from warp_mpm.plotting.points import pore_pressure as pore_pressure
from warp_mpm.plotting.points import still_times as still_times
from warp_mpm.plotting.scene import scene as scene
from warp_mpm.plotting.style import PlotError as PlotError
from warp_mpm.plotting.style import check_path as check_path
from warp_mpm.plotting.style import save as save

__all__ = [
    "PlotError",
    "check_path",
    "comparison",
    "field_panels",
    "force_and_displacement",
    "loads_by_height",
    "mechanism_diagram",
    "pore_pressure",
    "save",
    "scene",
    "still_times",
]
