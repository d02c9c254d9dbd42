"""Warp kernels, one file per effect, each built for a given set of effects. They know nothing of scenes or files."""
