"""Answers that take many coarse runs: the lightest barrier that keeps limits, and how likely limits are exceeded."""
