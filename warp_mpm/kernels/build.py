"""All kernels of one set of effects, built once."""

from __future__ import annotations

import os
from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from ..effects import Effects
from ..loading import no_garbage
from ..simulator.bodies.kernels import make_body_functions
from ..simulator.laws.law import all_functions as law_functions
from ..simulator.schemes.scheme import all_functions as scheme_functions
from .around import make_around
from .arrival import make_conveyor
from .clock import make_clock
from .constitutive import make_constitutive
from .contact import make_contact
from .elementary import make_elementary
from .grid_momentum import make_grid_momentum
from .layout import layout
from .ledger import make_ledger
from .nodes import make_nodes
from .pore_pressure import make_pore_pressure
from .seepage import make_seepage
from .shape_functions import make_shape_functions
from .transfer import make_transfer
from .vectors import make_vectors

CPU_COMPILER_FLAGS = (
    "-march=native -mllvm=-inline-threshold=9000 -mllvm=-inline-cold-callsite-threshold=3000 -ffp-contract=fast"
)
"""Warp's own flags without its bound on the depth of vectorisation, and with fused multiply-add."""

LONGEST_UNROLLED = 3
"""Rounds of the longest loop that is written out in full: over the nodes around a point, not over those of a block."""

CHECKED = os.environ.get("WARP_MPM_CHECKED", "") not in ("", "0")
"""Whether kernels are built for debugging: an index outside its array ends the process, and says so."""


@cache
@no_garbage()
def build_kernels(effects: Effects) -> SimpleNamespace:
    """Kernels for `effects`, and no others, in a Warp module of their own.

    Those over points stand in `of_kinds`, a namespace for each kind of material; those of the first, or only, one are
    among the others too. Each further kind has a module to itself, as kernels of a module are told apart by name.
    """
    module = effects.module_name
    options: dict[str, Any] = {
        "enable_backward": False,
        "cpu_compiler_flags": CPU_COMPILER_FLAGS,
        "max_unroll": LONGEST_UNROLLED if effects.dimensions == 2 else 1,
    }
    if CHECKED:
        options["mode"] = "debug"
    for name in effects.module_names:
        wp.set_module_options(options, module=wp.get_module(name))
    types = layout(effects)
    shapes = make_shape_functions(types)
    elementary = make_elementary(types)
    vectors = make_vectors(types)
    tools = SimpleNamespace(**elementary.__dict__, **make_around(types).__dict__, **shapes.__dict__, **vectors.__dict__)
    types.scheme = SimpleNamespace(**scheme_functions(effects.scheme, types, tools))
    bodies = make_body_functions(types, elementary) if effects.bodies else None
    of_scheme = effects.scheme.kernels(types, tools, module)
    of_kinds = []
    for of_kind, place in zip(effects.of_kinds, effects.module_names, strict=True):
        # The same structures for all kinds of material; what the kernels do with them is their own.
        own = SimpleNamespace(**types.__dict__ | {"effects": of_kind})
        own.law = SimpleNamespace(**law_functions(of_kind.skeleton, own, tools))
        pore = make_pore_pressure(own)
        of_kinds.append(
            SimpleNamespace(
                **make_transfer(own, shapes, vectors, pore, bodies, place).__dict__,
                **make_constitutive(own, shapes, vectors, pore, bodies, place).__dict__,
                ledger=make_ledger(own, vectors, pore, place).ledger,
                **of_scheme,
            )
        )
    clock = make_clock(types, bodies, module)
    kernels = SimpleNamespace(
        types=types,
        of_kinds=of_kinds,
        **of_kinds[0].__dict__,
        **make_nodes(types, module).__dict__,
        move=make_grid_momentum(types, vectors, module).move,
        start=clock.start,
        tick=clock.tick,
    )
    if effects.arriving:
        kernels.convey = make_conveyor(types, module)
    if effects.two_phase:
        kernels.seep = make_seepage(types, vectors, module).seep
    if effects.bodies:
        kernels.__dict__.update(make_contact(types, shapes, vectors, bodies, module).__dict__)
    return kernels
