"""Rooms of the simulator: how the skeleton answers a strain, how velocities go to the nodes and back, what the flow
meets, and in which order.

A file of a room declares its fields in the scenario and the functions of its kernels side by side.
"""
