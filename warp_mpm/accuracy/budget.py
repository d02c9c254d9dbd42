"""What makes up the uncertainty of a reference: the spacing, and every setting that the ladder of spacings shares."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from warp_mpm.accuracy.study import INTERVAL

SPACING, TOGETHER = "spacing", "all settings at once"

LABELS: Mapping[str, str] = {
    SPACING: "spacing",
    "courant_number": "time step",
    "transfer_damping": "rate β of the transfer",
    "pic_share": "PIC share of the transfer",
    "pressure_relaxation": "pressure relaxation",
    "bulk_viscosity": "bulk viscosity",
    "density_correction": "density correction",
    "points_per_cell": "points per cell",
    INTERVAL: "record interval",
    TOGETHER: TOGETHER,
}
"""Causes of uncertainty, in words."""


@dataclass(frozen=True)
class Budget:
    """Parts of the relative uncertainty of each quantity's reference.

    The spacing's part is that of the extrapolation along the ladder. A ladder at one Courant number and one strength of
    each filter cannot see what all its runs share, so each such setting was refined alone, by two, at a spacing of
    twice the finest or more. The causes have nothing to do with each other, so the changes are joined as the root of
    their squares. The run in which all settings are refined at once is the test of that: where it is farther off, its
    change counts.

    Halving takes half of an effect of first order away, and an effect that falls with the spacing is twice as large
    there as at the finest, or more: then the change is no less than what the finest run still has of it, and is taken
    as it is. Where everything refined does the same at two spacings, it goes on as it began, and counts twice; where it
    does this here and that there, it is scatter, which has no rest.
    """

    spacing: Mapping[str, float]
    """The spacing's part, by quantity."""
    settings: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Signed change of each quantity with one setting refined, by the setting's name."""
    together: Mapping[float, Mapping[str, float]] = field(default_factory=dict)
    """The same with all of them refined, by the spacing at which that was done [m]."""
    at: float | None = None
    """Spacing at which the settings were refined one by one [m]; None where they were not."""
    lost: tuple[str, ...] = ()
    """Settings whose refined run diverged: their parts are not known."""

    def shared(self, name: str) -> float:
        """Part of all settings that the ladder shares."""
        return (2.0 if self.stays(name) else 1.0) * self.change(name)

    def change(self, name: str) -> float:
        """What refining the settings changes: the root of their squares, or all at once where that is more."""
        squares = math.hypot(*(part.get(name, 0.0) for part in self.settings.values()))
        return max(squares, abs(self._at_once(name)))

    def stays(self, name: str) -> bool:
        """Whether all settings at once do the same at both spacings: what falls does so by an order of a half at least,
        and what grows by more than the root of two is scatter."""
        coarser = max((spacing for spacing in self.together if self.at is not None and spacing > self.at), default=None)
        if self.at is None or coarser is None:
            return False
        here, there = self._at_once(name), self.together[coarser].get(name, 0.0)
        return here * there > 0.0 and math.sqrt(self.at / coarser) < here / there <= math.sqrt(2.0)

    def total(self, name: str) -> float:
        """Relative uncertainty of a quantity's reference."""
        return math.hypot(self.spacing[name], self.shared(name))

    def greatest(self, name: str) -> str:
        """The cause that contributes most, in words; where settings are off at once that are not alone, these."""
        alone = {cause: abs(part[name]) for cause, part in self.settings.items() if name in part}
        most = max(alone, key=lambda cause: alone[cause], default=None)
        if most is None or self.spacing[name] >= self.shared(name):
            return LABELS[SPACING]
        return LABELS[most if 2.0 * alone[most] >= self.change(name) else TOGETHER]

    def _at_once(self, name: str) -> float:
        return 0.0 if self.at is None else self.together.get(self.at, {}).get(name, 0.0)
