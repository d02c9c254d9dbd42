"""Rooms of the simulator: how the skeleton answers a strain, how velocities go to the nodes and back, in which order.

A file of a room declares its fields in the scenario and the functions of its kernels side by side.
"""

# A scenario lists the laws and schemes, which take the types of their fields from its package: whoever is asked for
# first, the package of scenarios is the one that begins.
import warp_mpm.scenario as _  # noqa: F401
