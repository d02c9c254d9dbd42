"""Published formulas for the peak impact pressure on a fixed barrier, with how sure this project is of each.

A formula that could not be checked against its source carries `Confidence.UNVERIFIED`: it is off unless asked for,
and a coefficient that is not known has to come from the user. Symbols: rho density [kg/m^3], v speed [m/s], h depth
[m], g gravity [m/s^2], Fr = v / sqrt(g h).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.impact import STANDARD_GRAVITY
from analytic.scene import PAPER_GEOMETRY_CHANGE

Array = NDArray[np.float64]


class Confidence(Enum):
    """How sure this project is that the formula and its coefficients are those of the named source."""

    DERIVED = "derived"
    """Follows from a balance of mass and momentum; checked here."""
    KNOWN = "known"
    """Widely cited in this form; the source itself was not at hand."""
    SUPPORTED = "supported"
    """Recalled, not checked; the published fits to the 139 field events agree with this form and with no other."""
    UNVERIFIED = "unverified"
    """Neither formula nor coefficients could be checked."""


@dataclass(frozen=True)
class EmpiricalModel:
    """One formula p = p(rho, v, h, g; coefficients)."""

    name: str
    title: str
    formula: str
    """As text, with the coefficients' names."""
    coefficients: Mapping[str, float | None]
    """`None`: not known, the user has to give it."""
    source: str
    range: str
    """Range of the experiments or of the argument."""
    confidence: Confidence
    remark: str
    function: Callable[..., Array]
    """Of density, speed, height, gravity, and the coefficients by name."""

    @property
    def usable(self) -> bool:
        """Whether all coefficients are known."""
        return all(value is not None for value in self.coefficients.values())

    @property
    def on_by_default(self) -> bool:
        """Whether it takes part where no models are named."""
        return self.usable and self.confidence is not Confidence.UNVERIFIED

    def with_coefficients(self, **coefficients: float) -> EmpiricalModel:
        """The model with the user's coefficients.

        Raises:
            ValueError: a coefficient is unknown or not a finite number.
        """
        for key, value in coefficients.items():
            if key not in self.coefficients:
                known = ", ".join(self.coefficients) or "none"
                raise ValueError(f"{self.name} has no coefficient {key!r}, it has {known}.")
            if not np.isfinite(value):
                raise ValueError(f"{self.name}: {key} is {value}, it must be a finite number.")
        return replace(self, coefficients={**self.coefficients, **coefficients})

    def pressure(
        self, density: ArrayLike, speed: ArrayLike, height: ArrayLike, gravity: float = STANDARD_GRAVITY
    ) -> Array:
        """Peak pressure [Pa] for a density [kg/m^3], speed [m/s] and depth [m], which broadcast.

        Raises:
            ValueError: a coefficient is not known, or an input is not a positive finite number.
        """
        missing = [key for key, value in self.coefficients.items() if value is None]
        if missing:
            raise ValueError(
                f"{self.name} could not be verified and needs your coefficient {missing[0]} ({self.formula})."
            )
        arrays = []
        for label, values in (("density", density), ("speed", speed), ("height", height)):
            array = np.asarray(values, dtype=float)
            if not np.all(np.isfinite(array) & (array > 0)):
                bad = array[~(np.isfinite(array) & (array > 0))].flat[0]
                raise ValueError(f"{label} is {bad:g}, it must be a number in (0, inf).")
            arrays.append(array)
        return np.asarray(self.function(*arrays, gravity, **self.coefficients))


def froude_number(speed: ArrayLike, height: ArrayLike, gravity: float = STANDARD_GRAVITY) -> Array:
    """Fr = v / sqrt(g h) [-]."""
    return np.asarray(speed, dtype=float) / np.sqrt(gravity * np.asarray(height, dtype=float))


def _closed_form(rho: Array, v: Array, h: Array, g: float, geometry_change: float) -> Array:
    return 0.75 / geometry_change * rho * v**2


def _huebl_holzinger(rho: Array, v: Array, h: Array, g: float, k: float) -> Array:
    return k * rho * v**0.8 * (g * h) ** 0.6


def _armanini(rho: Array, v: Array, h: Array, g: float) -> Array:
    return rho * g * h / 2 * (1 + np.sqrt(2) * froude_number(v, h, g)) ** 2


def _cui(rho: Array, v: Array, h: Array, g: float, k: float, m: float) -> Array:
    return k * froude_number(v, h, g) ** m * rho * v**2


def _momentum_jet(rho: Array, v: Array, h: Array, g: float) -> Array:
    return rho * g * h / 2 + rho * v**2


def _bore(rho: Array, v: Array, h: Array, g: float) -> Array:
    return rho * g * h / 2 * reflected_depth_ratio(froude_number(v, h, g)) ** 2


def _hydrodynamic(rho: Array, v: Array, h: Array, g: float, a: float) -> Array:
    return a * rho * v**2


def _mixed(rho: Array, v: Array, h: Array, g: float, a: float, b: float) -> Array:
    return a * rho * g * h + b * rho * v**2


def reflected_depth_ratio(froude: ArrayLike) -> Array:
    """Depth of a bore reflected by a wall over the depth of the flow [-].

    The root x > 1 of (x - 1)^2 (x + 1) = 2 Fr^2 x: mass and momentum balance across the bore that leaves a wall which
    stops a flow of the Froude number `froude`.
    """
    fr = np.asarray(froude, dtype=float)
    # Newton from above: the cubic x^3 - x^2 - (1 + 2 Fr^2) x + 1 is convex there, so the steps go down to the root.
    x = 2 + np.sqrt(2) * fr
    for _ in range(60):
        step = (x**3 - x**2 - (1 + 2 * fr**2) * x + 1) / (3 * x**2 - 2 * x - (1 + 2 * fr**2))
        x = x - step
        if np.all(np.abs(step) <= 1e-15 * x):
            break
    return x


_NO_RANGE = "not stated"

MODELS: Mapping[str, EmpiricalModel] = {
    model.name: model
    for model in (
        EmpiricalModel(
            "closed_form",
            "Closed form, fixed barrier",
            "p = (0.75 / geometry_change) rho v^2",
            {"geometry_change": PAPER_GEOMETRY_CHANGE["fixed"]},
            "Cuomo, Di Perna and Martinelli: F_peak of Eqs. (5)-(8) over h with m2 -> inf and s1max = lambda L",
            "the paper's lambda = 0.72 is a fit to its own simulations",
            Confidence.DERIVED,
            "Length, volume and depth of the flow cancel: a purely hydrodynamic formula.",
            _closed_form,
        ),
        EmpiricalModel(
            "huebl_holzinger_2003",
            "Hübl and Holzinger (2003)",
            "p = k rho v^0.8 (g h)^0.6",
            {"k": 4.5},
            "Hübl and Holzinger (2003)",
            "miniature tests; dimensionless form 4.5 Fr^-1.2",
            Confidence.KNOWN,
            "Some reviews print k = 5.",
            _huebl_holzinger,
        ),
        EmpiricalModel(
            "armanini_2011",
            "Armanini et al. (2011)",
            "p = (rho g h / 2) (1 + sqrt(2) Fr)^2",
            {},
            "Armanini, Larcher and Odorizzi (2011)",
            "vertical wall, flow fully reflected; mean pressure over the flow's depth",
            Confidence.SUPPORTED,
            "Of the forms in use, this one gives the paper's slope of 1.61 together with Cui's 0.93.",
            _armanini,
        ),
        EmpiricalModel(
            "cui_2015",
            "Cui et al. (2015)",
            "p = k Fr^m rho v^2",
            {"k": 5.3, "m": -1.5},
            "Cui, Zeng and Lei (2015)",
            "flume, depth 7.2-11.2 cm, speed 2.4-5.2 m/s",
            Confidence.KNOWN,
            "",
            _cui,
        ),
        EmpiricalModel(
            "momentum_jet",
            "Momentum jet (Arattano and Franzi 2003)",
            "p = rho g h / 2 + rho v^2",
            {},
            "Arattano and Franzi (2003), Nat. Hazards Earth Syst. Sci. 3",
            "steady jet turned by 90 degrees, hydrostatic thrust of the flow",
            Confidence.KNOWN,
            "Force per width over the depth h.",
            _momentum_jet,
        ),
        EmpiricalModel(
            "shallow_water_bore",
            "Reflected shallow-water bore",
            "p = (rho g h / 2) x^2, (x - 1)^2 (x + 1) = 2 Fr^2 x",
            {},
            "mass and momentum balance across the reflected bore",
            "wall that is not overtopped, hydrostatic pressure behind the bore",
            Confidence.DERIVED,
            "Thrust of the reflected depth x h over the depth h.",
            _bore,
        ),
        EmpiricalModel(
            "hungr_1984",
            "Hungr et al. (1984)",
            "p = a rho v^2",
            {"a": None},
            "Hungr, Morgan and Kellerhals (1984)",
            _NO_RANGE,
            Confidence.UNVERIFIED,
            "Often quoted with a = 1.5, which was not checked against the source.",
            _hydrodynamic,
        ),
        EmpiricalModel(
            "vagnon_2020",
            "Vagnon (2020)",
            "p = a rho g h + b rho v^2",
            {"a": None, "b": None},
            "Vagnon (2020), Landslides 17:313",
            _NO_RANGE,
            Confidence.UNVERIFIED,
            "The source's formula was not at hand; the mixed form stands in for it and takes your coefficients.",
            _mixed,
        ),
        EmpiricalModel(
            "di_perna_2022",
            "Di Perna et al. (2022)",
            "p = a rho g h + b rho v^2",
            {"a": None, "b": None},
            "Di Perna, Cuomo and Martinelli (2022), Geoenvironmental Disasters 9:8",
            _NO_RANGE,
            Confidence.UNVERIFIED,
            "The source's formula was not at hand; the mixed form stands in for it and takes your coefficients.",
            _mixed,
        ),
    )
}
"""All models by name."""


def select(
    names: Sequence[str] = (), coefficients: Mapping[str, Mapping[str, float]] = MappingProxyType({})
) -> list[EmpiricalModel]:
    """The models called `names` with the user's `coefficients` by model name; by default those on by default.

    A model for which coefficients are given takes part whether or not it is on by default.

    Raises:
        ValueError: a name is unknown, or a model still lacks a coefficient.
    """
    for name in [*names, *coefficients]:
        if name not in MODELS:
            raise ValueError(f"model is {name!r}, it must be one of {', '.join(MODELS)}.")
    models = {name: MODELS[name].with_coefficients(**coefficients.get(name, {})) for name in MODELS}
    chosen = names or [name for name, model in models.items() if MODELS[name].on_by_default or name in coefficients]
    for name in chosen:
        if not models[name].usable:
            missing = next(key for key, value in models[name].coefficients.items() if value is None)
            raise ValueError(
                f"{name} could not be verified and needs your coefficient {missing} ({models[name].formula})."
            )
    return [models[name] for name in chosen]
