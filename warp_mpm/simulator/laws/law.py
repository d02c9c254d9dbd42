"""What a law of the skeleton is: everything that the simulation must be told of it, in one object."""

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from warp_mpm.schema import Model

from ..point_field import PointField

Array = NDArray[np.float64]


class Law:
    """How the skeleton's effective stress follows from its strain.

    Elasticity is common to all laws (Young's modulus and Poisson's ratio are fields of every material) and is what a
    law has that overrides nothing. `material` below is that of the scenario, with the fields of `Settings` beside those
    of every skeleton (`warp_mpm.scenario.Skeleton`). Stresses are [Pa], tension positive.
    """

    name: ClassVar[str]
    """In the scenario: `flow.material.law`."""
    title: ClassVar[str]
    """What it is, in a clause, with its source."""
    Settings: ClassVar[type[Model]] = Model
    """Its fields in `flow.material`, with limits and docstrings."""
    dimensions: ClassVar[tuple[int, ...]] = (2,)
    """In how many it works: 3 too, where its functions take `types.T` and `types.G` in place of V4."""
    point_fields: ClassVar[Mapping[str, PointField]] = {}
    """What a point stores for it."""
    constants: ClassVar[tuple[str, ...]] = ()
    """Numbers that its functions read from the parameters, beside `lame`, `shear_modulus` and `bulk_modulus` [Pa]."""
    opens: ClassVar[bool] = False
    """Whether the skeleton may open: the gap is then followed, and must close before the skeleton bears again."""
    extra_stress: ClassVar[bool] = False
    """Whether there is a stress beside the one that is remembered, such as a viscous one."""
    dilates: ClassVar[bool] = False
    """Whether its skeleton takes `flow.material.dilatancy` (`dilatancy.make_dilatancy`)."""
    vectorised: ClassVar[bool] = True
    """Whether `back` is free of branches and calls, so that it stands in `update`; else it gets a kernel of its own."""

    # -- numbers of a scene ----------------------------------------------------------------------------------------

    def numbers(self, material: Any) -> dict[str, float]:
        """Values of `constants`."""
        return {}

    def bears_tension(self, material: Any) -> bool:
        """Whether a point that is alone on its nodes can swing, which bounds the time step more than a full grid."""
        return True

    def largest_step(self, material: Any, *, spacing: float, density: float) -> float:
        """Largest stable time step [s], beside that of waves.

        Args:
            material: of the scenario.
            spacing: of the grid [m].
            density: mass that moves with the solid, per volume of the whole [kg/m³].
        """
        return math.inf

    def friction(self, material: Any) -> float:
        """tan φ of its friction at rest, which dilatancy adds to; of a law that `dilates`."""
        return 0.0

    def lateral_stress_ratio(self, material: Any) -> float:
        """Horizontal over vertical effective stress at rest, K0 [-]; by default that of an elastic layer."""
        return material.poisson_ratio / (1.0 - material.poisson_ratio)

    def lateral_stress_range(self, material: Any, vertical: float) -> tuple[float, float]:
        """Least and greatest ratio of horizontal to vertical effective stress [-] that the law allows at rest.

        Args:
            material: of the scenario.
            vertical: effective stress, compression positive, at least 0 [Pa].
        """
        return 0.0, math.inf

    def caveats(self, material: Any) -> list[str]:
        """What looks like a slip in the material's figures; one sentence each."""
        return []

    def grain_diameter(self, material: Any) -> float | None:
        """Diameter of the grains [m], where the law asks for it."""
        return None

    def fluid_viscosity(self, material: Any) -> float | None:
        """Viscosity of what is between the grains [Pa s], where the law asks for it."""
        return None

    def dimensionless(self, material: Any, *, rate: float, pressure: float) -> dict[str, float]:
        """Numbers of its own, by name, of a flow that shears at `rate` [1/s] under an effective pressure [Pa]."""
        return {}

    def says(self, numbers: Mapping[str, float]) -> str:
        """What the numbers of a flow (`warp_mpm.regime`) say of this law, in a clause; empty: nothing against another
        one."""
        return ""

    # -- what a result is held against -----------------------------------------------------------------------------

    def strength(self, material: Any) -> float:
        """Tension or shear [Pa] that the skeleton bears without pressure; infinite where nothing bounds the stress."""
        return math.inf

    def yield_excess(self, material: Any, stress: Array) -> Array | None:
        """Distance [N] [Pa] by which stresses [N, 4] (xx, yy, zz, xy) lie outside of what the law allows; None where it
        allows all."""
        return None

    def undecided_energy(self, material: Any, volume: Array, stress: Array) -> float:
        """Energy [J/m] that N points with volumes [N] and stresses [N, 4] may hold beyond what is recorded of it: the
        law is no potential.

        Shear stress s stores V s² / 4 G if the shear is undone at the volume V, and less by 1 + p / K if the volume
        goes first. The record holds the lesser; what was there at the start may have been the greater.
        """
        xx, yy, zz, xy = stress.T
        mean = (xx + yy + zz) / 3.0
        squares = (xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2.0 * xy**2
        pressure = np.maximum(-mean, 0.0)
        share = pressure / (material.bulk_modulus + pressure)
        return float(np.sum(volume * squares / (4.0 * material.shear_modulus) * share))

    # -- kernels -----------------------------------------------------------------------------------------------------

    def functions(self, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
        """Its Warp functions, of which any may be left out.

        `types` holds the scalar type, the vectors V2, V3, V4, the structures Points and Parameters, and in `effects`
        what there is; `tools` the functions `read(array, p)`, `write(array, p, value)`, `larger` and `smaller`.
        A tensor is V4: xx, yy, zz, xy; the velocity gradient dvx/dx, dvx/dy, dvy/dx, dvy/dy [1/s]. A law that works
        in space too names them `types.T` and `types.G`, of which the components stand in `kernels/vectors.py`.

        - `trial(points, p, stress: V4, gradient: V4, volume_strain, time_step, parameters) -> V4, scalar`: stress after
          an elastic step, and the deviatoric strain of the step [-]. `volume_strain` is what the skeleton bears of it.
          Default: `elastic.make_elasticity`, Eq. (A3).
        - `back(points, p, stress: V4, gradient: V4, volume, time_step, parameters) -> V4, scalar`: from the trial
          stress to the one that the law allows, and by how much the skeleton opens [-, of the volume after it]. Own
          point fields are read and written here. Default: as it is, and no opening.
        - `extra(points, p, stress: V4, gradient: V4, time_step, parameters) -> V4`: with `extra_stress`, what acts
          beside the stress that `back` returned.
        - `stored(stress: V4, volume, grains, parameters) -> float64`: energy that can be had back [J/m] from a point of
          that volume [m³/m], of which its grains take up `grains`. Default: elastic.
        - `leave(points, p)`: a point leaves the domain; `update` goes on passing over it, with a gradient of zero.
        """
        return {}


def all_functions(law: Law, types: SimpleNamespace, tools: SimpleNamespace) -> dict[str, Any]:
    """The functions of a law, defaults filled in, and `volume_ratio`."""
    import warp as wp

    from .elastic import make_elasticity, make_stored_energy

    F, T, G = types.scalar, types.T, types.G
    Points, Parameters = types.Points, types.Parameters

    elasticity = make_elasticity(types)
    trial_stress = elasticity.trial_stress

    @wp.func
    def trial(
        points: Points,
        p: wp.int32,
        stress: T,
        gradient: G,
        volume_strain: F,
        time_step: F,
        parameters: Parameters,
    ):
        return trial_stress(stress, gradient, volume_strain, time_step, parameters)

    @wp.func
    def back(points: Points, p: wp.int32, stress: T, gradient: G, volume: F, time_step: F, parameters: Parameters):
        return stress, F(0.0)

    @wp.func
    def extra(points: Points, p: wp.int32, stress: T, gradient: G, time_step: F, parameters: Parameters) -> T:
        return T()

    @wp.func
    def leave(points: Points, p: wp.int32):
        pass

    defaults = {
        "trial": trial,
        "back": back,
        "extra": extra,
        "stored": make_stored_energy(types, tools),
        "leave": leave,
        "volume_ratio": elasticity.volume_ratio,
    }
    return defaults | law.functions(types, tools)
