"""Laws of the skeleton, and the door through which a script brings its own.

>>> from warp_mpm.laws import Law, register
>>> class Mine(Law): ...
>>> register(Mine())

From then on scenarios take it by its name (`flow.material.law`), with its own fields, and it is compiled as any other
effect. `docs/develop/add_a_law.md` goes through one.
"""

from __future__ import annotations

from warp_mpm.scenario.material import TwoPhaseMaterial
from warp_mpm.scenario.scene import offer_anew
from warp_mpm.schema import Model
from warp_mpm.simulator.laws import LAWS, Law
from warp_mpm.simulator.point_field import PointField

__all__ = ["Law", "Model", "PointField", "names", "register"]


def register(law: Law) -> None:
    """Make scenarios take a law of your own. Another one of its name, registered before, gives way to it.

    Args:
        law: an instance of your class, which names it, its fields and its functions.

    Raises:
        ValueError: its name is no name or one of the package's own, or a field of it is one that every material has.
    """
    taken = sorted(set(law.Settings.model_fields) & set(TwoPhaseMaterial.model_fields))
    if taken:
        raise ValueError(f"the law {law.name!r} must not have the field {taken[0]}, which every material has")
    LAWS.add(law)
    offer_anew()


def names() -> tuple[str, ...]:
    """Names that `flow.material.law` may have now."""
    return LAWS.names
