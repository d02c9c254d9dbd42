"""Deliberately nasty scenes, what is demanded of them, and the record of how they fare: docs/robustness.md."""
