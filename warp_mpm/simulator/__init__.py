"""The rooms of the simulator: one idea each, whose next kind is one new file."""
