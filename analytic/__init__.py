"""Closed-form impact model of a debris flow on a rigid barrier, empirical formulas, calibration and barrier design."""
