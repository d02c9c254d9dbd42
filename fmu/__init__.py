"""FMI co-simulation units of the closed-form model and of the simulator."""
