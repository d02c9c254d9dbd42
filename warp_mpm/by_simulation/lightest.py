"""The search for the least of an objective on one or two variables, where limits hold; it knows nothing of barriers.

Along a line on which the first variable goes from light to heavy, a limit that is broken at the light end is taken to
hold from some point on. That is an assumption, which every pair of trials is held against, and points lighter than the
answer besides (`sampled`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

Point = tuple[float, ...]
"""Values of the variables, in their order."""

Evaluate = Callable[[Sequence[Point]], Sequence[float]]
"""Excesses of points over the limits: at most 0 where all are kept. Points of one call are looked at together."""

Weigh = Callable[[Point], float]
"""The objective, which costs nothing; infinite where a point is no possible barrier."""

LINES = 5
"""Values of the second variable with which the search begins."""

REFINEMENTS = 4
"""How often the second variable is then halved about the best line."""

CLEARLY = 0.03
"""By what share a line must be heavier than the best, as far as it is known, to be left."""

ROUNDS = 12
"""Most calls for one set of lines."""


@dataclass(frozen=True)
class Box:
    """Bounds of each variable."""

    low: Point
    high: Point

    def at(self, index: int, share: float) -> float:
        """Value of a variable at a share of its range."""
        return self.low[index] + share * (self.high[index] - self.low[index])


@dataclass(frozen=True)
class Tried:
    """A point, its objective and its excess."""

    point: Point
    objective: float
    excess: float

    @property
    def holds(self) -> bool:
        """Whether all limits are kept."""
        return self.excess <= 0.0


@dataclass
class Line:
    """A bracket on one line: shares of the first variable's range, from light (0) to heavy (1)."""

    second: float | None
    """Value of the second variable."""
    guesses: list[float]
    """Where to look first."""
    seen: dict[float, float] = field(default_factory=dict)
    """Excess by share."""
    closed: bool = False

    @property
    def holding(self) -> float | None:
        """Lightest share that holds."""
        return min((share for share, excess in self.seen.items() if excess <= 0.0), default=None)

    @property
    def broken(self) -> float | None:
        """Heaviest share below it that does not."""
        above = self.holding if self.holding is not None else math.inf
        return max((share for share, excess in self.seen.items() if excess > 0.0 and share < above), default=None)

    def next(self, width: float) -> list[float]:
        """Shares to look at next, to bracket the answer within `width`; none where that is done."""
        holding, broken = self.holding, self.broken
        if not self.seen:
            near = [min(max(guess + step, 0.0), 1.0) for guess in self.guesses for step in (-0.05, 0.05)]
            return list(dict.fromkeys(near or [0.0, 0.5, 1.0]))
        if holding is None:
            return [] if 1.0 in self.seen else self._beyond(1.0)
        if broken is None:
            return [] if holding <= 0.0 else self._beyond(0.0)
        if holding - broken <= width:
            return []
        # Where the straight line between the two meets the limit, and a little to both sides, so that both ends move.
        meets = self.meets
        reach = max(0.45 * width, 0.1 * (holding - broken))
        inside = 0.02 * (holding - broken)
        found = [min(max(meets + step, broken + inside), holding - inside) for step in (-reach, reach)]
        return list(dict.fromkeys(found))

    @property
    def meets(self) -> float:
        """Where the straight line over the bracket meets the limit."""
        holding, broken = self.holding, self.broken
        assert holding is not None
        assert broken is not None
        low, high = self.seen[broken], self.seen[holding]
        return broken + (holding - broken) * low / (low - high) if low > high else 0.5 * (broken + holding)

    def _beyond(self, end: float) -> list[float]:
        """Toward an end, where all that was seen lies on one side: where the last two lead, on both sides of it; the
        end itself where they lead nowhere, or were looked beyond before."""
        shares = sorted(self.seen, key=lambda share: abs(end - share))
        if len(shares) in (2, 3):
            (near, far), slope = shares[:2], self.seen[shares[0]] - self.seen[shares[1]]
            if slope * (self.seen[near] or 1e-9) < 0.0:
                meets = near - self.seen[near] * (near - far) / slope
                step = 0.25 * abs(meets - near) + 0.02
                found = [meets - step, meets + step]
                if all(min(near, end) < share < max(near, end) for share in found):
                    return found
        return [end]


class Search:
    """The search, which keeps all that was tried."""

    def __init__(
        self,
        box: Box,
        weigh: Weigh,
        evaluate: Evaluate,
        *,
        guess: Callable[[float | None], float | None] = lambda second: None,
        tolerance: float = 0.02,
    ):
        """Begin with nothing tried.

        Args:
            box: one or two variables.
            weigh: the objective.
            evaluate: the trials.
            guess: a value of the first variable to begin with on a line of the second; None: none.
            tolerance: share of the objective to which the answer is found.
        """
        self.box, self.tolerance, self.rounds = box, tolerance, 0
        self.tried: dict[Point, Tried] = {}
        self._weigh, self._evaluate, self._guess = cache(weigh), evaluate, guess
        middle = [box.at(index, 0.5) for index in range(len(box.low))]
        ends = [self._weigh((box.at(0, share), *middle[1:])) for share in (0.0, 1.0)]
        self._grows = ends[0] <= ends[1]

    @property
    def best(self) -> Tried | None:
        """The lightest that holds."""
        return min((one for one in self.tried.values() if one.holds), key=lambda one: one.objective, default=None)

    @property
    def nearest(self) -> Tried:
        """The one that breaks the limits least."""
        return min(self.tried.values(), key=lambda one: (one.excess, -one.objective))

    def run(self) -> Tried | None:
        """Find the lightest point that holds; None where no line has one."""
        if len(self.box.low) == 1:
            self._settle([Line(None, self._first(None))])
            return self.best
        lines = [self._line(self.box.at(1, number / (LINES - 1))) for number in range(LINES)]
        self._settle(lines)
        for _ in range(REFINEMENTS):
            before = self.best
            if before is None:
                break
            seconds = sorted(line.second for line in lines if line.second is not None)
            place = seconds.index(before.point[1]) if before.point[1] in seconds else None
            if place is None:
                break
            around = [seconds[i] for i in (place - 1, place + 1) if 0 <= i < len(seconds)]
            new = [self._line(0.5 * (before.point[1] + second), lines) for second in around]
            self._settle(new)
            lines += new
            after = self.best
            assert after is not None
            step = abs(around[0] - before.point[1]) / (self.box.high[1] - self.box.low[1])
            if before.objective - after.objective < self.tolerance * before.objective and step < 0.15:
                break
        return self.best

    def lighter(self, count: int) -> list[Point]:
        """Points of the box that are lighter than the answer by up to three tenths, spread over it (Halton)."""
        from scipy.stats import qmc

        best = self.best
        if best is None or count == 0:
            return []
        found: list[Point] = []
        for shares in qmc.Halton(len(self.box.low), rng=0).random(400):
            point = tuple(self.box.at(index, float(share)) for index, share in enumerate(shares))
            if 0.7 * best.objective <= self._weigh(point) < (1.0 - self.tolerance) * best.objective:
                found.append(point)
        return found[:count]

    def sampled(self, points: Sequence[Point]) -> list[Tried]:
        """Points that are lighter than the answer, tried: by the assumption none of them holds. Where one does, the
        search goes on from it.
        """
        self._try(points)
        found = [self.tried[point] for point in points]
        lightest = min((one for one in found if one.holds), key=lambda one: one.objective, default=None)
        if lightest is not None:
            line = Line(lightest.point[1] if len(lightest.point) > 1 else None, [])
            line.seen = {self._share(lightest.point[0]): lightest.excess}
            self._settle([line])
        return found

    def again(self, points: Iterable[Point]) -> Tried | None:
        """Find the lightest point on the lines of points that were tried before, under limits that have changed a
        little; none where no line has one.
        """
        points = list(points)
        self._try(points)
        lines: dict[float | None, Line] = {}
        for point in points:
            second = point[1] if len(point) > 1 else None
            line = lines.setdefault(second, Line(second, []))
            line.seen[self._share(point[0])] = self.tried[point].excess
        # Lone points were samples; a line that had an end has more.
        self._settle([line for line in lines.values() if len(line.seen) > 1 or len(lines) == 1])
        return self.best

    def contradictions(self) -> list[tuple[Tried, Tried]]:
        """Pairs of a trial that holds and one that does not, though no variable of it is lighter."""
        found = []
        directions = self._directions()
        for one in self.tried.values():
            for other in self.tried.values():
                steps = [sign * (b - a) for sign, a, b in zip(directions, one.point, other.point, strict=True)]
                if one.holds and not other.holds and min(steps) >= 0.0:
                    found.append((one, other))
        return found

    def _directions(self) -> list[float]:
        """+1 of a variable with which the objective grows, -1 of one with which it falls."""
        signs = []
        for index in range(len(self.box.low)):
            ends = []
            for share in (0.0, 1.0):
                point = [self.box.at(other, 0.5) for other in range(len(self.box.low))]
                point[index] = self.box.at(index, share)
                ends.append(self._weigh(tuple(point)))
            signs.append(1.0 if ends[0] <= ends[1] else -1.0)
        return signs

    def _line(self, second: float, others: Sequence[Line] = ()) -> Line:
        """A line, to begin where its neighbours ended, or else at the guess."""
        ends = sorted(
            (line.second, line.holding) for line in others if line.holding is not None and line.second is not None
        )
        if ends:
            known = np.array(ends, dtype=float)
            return Line(second, [float(np.interp(second, known[:, 0], known[:, 1]))])
        return Line(second, self._first(second))

    def _first(self, second: float | None) -> list[float]:
        value = self._guess(second)
        return [] if value is None else [min(max(self._share(value), 0.06), 0.94)]

    def _settle(self, lines: Sequence[Line]) -> None:
        """Bring all lines to an end, looking at all of them at once."""
        for _ in range(ROUNDS):
            wanted = [(line, share) for line in lines if not line.closed for share in self._wanted(line)]
            if not wanted:
                return
            self._try([self._point(line, share) for line, share in wanted])
            for line, share in wanted:
                line.seen[share] = self.tried[self._point(line, share)].excess

    def _wanted(self, line: Line) -> Iterable[float]:
        best, broken = self.best, line.broken
        if best is not None and broken is not None:
            least = self._weigh(self._point(line, broken))
            # All that is lighter is broken: the line's answer is heavier than the best there is.
            if least >= best.objective:
                line.closed = True
                return []
        if best is not None and broken is not None and line.holding is not None:
            # Not worth the last digits.
            line.closed = self._weigh(self._point(line, line.meets)) > (1.0 + CLEARLY) * best.objective
            if line.closed:
                return []
        found = line.next(self._width(line))
        line.closed = not found
        return [share for share in found if math.isfinite(self._weigh(self._point(line, share)))]

    def _width(self, line: Line) -> float:
        """Width of a bracket that is as wide as the tolerance of the objective."""
        ends = [self._weigh(self._point(line, share)) for share in (0.0, 1.0)]
        holding = line.holding if line.holding is not None else 1.0
        here = self._weigh(self._point(line, holding))
        slope = abs(ends[1] - ends[0])
        return self.tolerance * here / slope if slope > 0.0 and math.isfinite(slope) else self.tolerance

    def _try(self, points: Iterable[Point]) -> None:
        new = [point for point in dict.fromkeys(points) if point not in self.tried]
        if not new:
            return
        self.rounds += 1
        for point, excess in zip(new, self._evaluate(new), strict=True):
            self.tried[point] = Tried(point, self._weigh(point), float(excess))

    def _point(self, line: Line, share: float) -> Point:
        first = self.box.at(0, share if self._grows else 1.0 - share)
        return (first,) if line.second is None else (first, line.second)

    def _share(self, value: float) -> float:
        share = (value - self.box.low[0]) / (self.box.high[0] - self.box.low[0])
        return share if self._grows else 1.0 - share
