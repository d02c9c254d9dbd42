"""The sides of a channel, which no section shows: planes across z."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from .outline import ENDLESS, Outline, Segments


class Side(Outline):
    """A plane across z.

    Args:
        z: where it stands [m].
        facing: 1 where the flow lies behind it, at greater z, and -1 where it lies before it.
    """

    def __init__(self, z: float, facing: int) -> None:
        super().__init__([[0.0, 0.0], [1.0, 0.0]], closed=False)
        self.z, self.facing = z, facing

    @cached_property
    def segments(self) -> Segments:
        """In the section it is one piece that is nowhere: every place is far before it."""
        nowhere, nil = np.zeros((1, 2)), np.zeros(1)
        return Segments(nowhere, nowhere, nil, nil, nowhere, nil - ENDLESS, False)
