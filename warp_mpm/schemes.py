"""Transfer schemes, and the door through which a script brings its own.

>>> from warp_mpm.schemes import Scheme, register
>>> class Mine(Scheme): ...
>>> register(Mine())

From then on scenarios take it by its name (`numerics.transfer`), and `numerics` has its fields.
`docs/develop/add_a_scheme.md` goes through one.
"""

from __future__ import annotations

from warp_mpm.scenario.scene import offer_anew
from warp_mpm.scenario.settings import Numerics
from warp_mpm.schema import Model
from warp_mpm.simulator.point_field import PointField
from warp_mpm.simulator.schemes import SCHEMES, Scheme
from warp_mpm.simulator.schemes.aflip import Aflip
from warp_mpm.simulator.schemes.apic import Apic
from warp_mpm.simulator.schemes.flip import Flip
from warp_mpm.simulator.step import Launch

__all__ = ["Aflip", "Apic", "Flip", "Launch", "Model", "PointField", "Scheme", "names", "register"]


def register(scheme: Scheme) -> None:
    """Make scenarios take a scheme of your own. Another one of its name, registered before, gives way to it.

    Args:
        scheme: an instance of your class, which names it, its fields and its functions.

    Raises:
        ValueError: its name is no name or one of the package's own, a field of it is one that `numerics` has already,
            or has no default.
    """
    before = SCHEMES.named(scheme.name).settings.model_fields if scheme.name in SCHEMES.names else {}
    for name, field in scheme.settings.model_fields.items():
        if name in Numerics.model_fields and name not in before and field is not Numerics.model_fields[name]:
            raise ValueError(f"the scheme {scheme.name!r} must not have the field {name}, which numerics has already")
        if field.is_required():
            raise ValueError(f"the field {name} of the scheme {scheme.name!r} must have a default")
    SCHEMES.add(scheme)
    offer_anew()


def names() -> tuple[str, ...]:
    """Names that `numerics.transfer` may have now."""
    return SCHEMES.names
