"""Solid bodies that a flow meets: outline, surfaces, motion."""

from .body import Body, Driven, Fixed, Sliding, Surface
from .outline import Outline

__all__ = ["Body", "Driven", "Fixed", "Outline", "Sliding", "Surface"]
