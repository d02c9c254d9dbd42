"""The constitutive functions of the simulator, driven directly: one thread per element."""

import math
from functools import cache
from types import SimpleNamespace

import numpy as np
import warp as wp

from warp_mpm.effects import Effects
from warp_mpm.kernels.elementary import make_elementary
from warp_mpm.kernels.layout import layout
from warp_mpm.simulator.laws.elastic import make_elasticity
from warp_mpm.simulator.laws.mohr_coulomb import make_return_mapping, yield_constants
from warp_mpm.validation.case import Array


@cache
def _kernels() -> SimpleNamespace:
    """Kernels `drive` (a path of equal displacement gradients) and `map_back` (the return mapping alone)."""
    types = layout(Effects(formulation="dry"))
    module = wp.get_module("warp_mpm.validation.elements")
    wp.set_module_options({"enable_backward": False}, module=module)
    trial_stress = make_elasticity(types).trial_stress
    return_mapping = make_return_mapping(types, make_elementary(types))
    V4, Parameters = types.V4, types.Parameters

    @wp.kernel(module=module)
    def drive(
        stress: wp.array(dtype=V4),  # type: ignore[valid-type]
        gradient: wp.array(dtype=V4),  # type: ignore[valid-type]
        steps: wp.int32,
        plastic: wp.int32,
        parameters: Parameters,  # type: ignore[valid-type]
        opening: wp.array(dtype=wp.float64),  # type: ignore[valid-type]
    ):
        e = wp.tid()
        s = stress[e]
        g = gradient[e]
        for _step in range(steps):
            s, _ = trial_stress(s, g, g[0] + g[3], wp.float64(1.0), parameters)
            if plastic == 1:
                s, opened = return_mapping(s, parameters)
                opening[e] = opening[e] + opened
        stress[e] = s

    @wp.kernel(module=module)
    def map_back(
        stress: wp.array(dtype=V4),  # type: ignore[valid-type]
        parameters: Parameters,  # type: ignore[valid-type]
    ):
        e = wp.tid()
        s, _ = return_mapping(stress[e], parameters)
        stress[e] = s

    return SimpleNamespace(types=types, drive=drive, map_back=map_back)


class Soil:
    """Linear elastic, Mohr-Coulomb with tension cut-off, as the simulator has it. Angles in degrees, stresses in Pa."""

    def __init__(
        self,
        *,
        young: float = 2e6,
        poisson: float = 0.25,
        friction: float = 20.0,
        dilatancy: float = 0.0,
        cohesion: float = 0.0,
        tension: float = 0.0,
        plasticity: bool = True,
    ):
        self.shear = young / (2.0 * (1.0 + poisson))
        self.lame = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
        self.sin_friction = math.sin(math.radians(friction))
        self.sin_dilatancy = math.sin(math.radians(dilatancy))
        self.cohesion_term = 2.0 * cohesion * math.cos(math.radians(friction))
        self.tension = min(tension, cohesion / math.tan(math.radians(friction)) if friction > 0.0 else math.inf)
        self.plasticity = plasticity
        self._kernels = _kernels()
        self._parameters = self._kernels.types.Parameters()
        constants = yield_constants(
            lame=self.lame,
            shear_modulus=self.shear,
            friction_angle=math.radians(friction),
            dilatancy_angle=math.radians(dilatancy),
            cohesion=cohesion,
            tension_cutoff=tension,
        )
        elastic = {"lame": self.lame, "shear_modulus": self.shear, "bulk_modulus": self.lame + 2.0 / 3.0 * self.shear}
        for name, value in (constants | elastic).items():
            setattr(self._parameters, name, value)

    def drive(self, stress: Array, gradient: Array, steps: int) -> tuple[Array, Array]:
        """Stress [N, 4] and opening [N] after `steps` equal displacement gradients [N, 4] (xx, xy, yx, yy)."""
        V4 = self._kernels.types.V4
        state = wp.array(np.atleast_2d(stress), dtype=V4, device="cpu")
        path = wp.array(np.atleast_2d(gradient), dtype=V4, device="cpu")
        opening = wp.zeros(len(state), dtype=wp.float64, device="cpu")
        inputs = [state, path, steps, int(self.plasticity), self._parameters, opening]
        wp.launch(self._kernels.drive, dim=len(state), inputs=inputs, device="cpu")
        return state.numpy(), opening.numpy()

    def map_back(self, trial: Array) -> Array:
        """Stress [N, 4] on or inside the yield surface, from trial stresses [N, 4]."""
        state = wp.array(trial, dtype=self._kernels.types.V4, device="cpu")
        wp.launch(self._kernels.map_back, dim=len(state), inputs=[state, self._parameters], device="cpu")
        return state.numpy()
