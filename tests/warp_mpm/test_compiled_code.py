"""What compilers make of the kernels: vector instructions for a processor, code for a graphics processor."""

import json
import os
import platform
import re
import subprocess
import sys
from pathlib import Path

import pytest
import warp as wp

from warp_mpm.effect_rules import derive_effects
from warp_mpm.kernels.build import build_kernels

REPOSITORY = Path(__file__).parents[2]

COMPILE = """
import sys
from unittest.mock import patch

import warp as wp
from warp_mpm import Scenario
from warp_mpm.effect_rules import derive_effects
from warp_mpm.kernels import build

build.CPU_COMPILER_FLAGS += " -Rpass=loop-vectorize"
effects = derive_effects(Scenario.load(sys.argv[1]))
build.build_kernels(effects)
module = wp.get_module(effects.module_name)
module.options["block_dim"] = 1  # as on a processor
with patch("warp._src.build.build_cpu"):  # the source of all of it, which nobody compiles
    wp.compile_aot_module(module, device="cpu", module_dir=f"{sys.argv[2]}/all")
of_update = [kernel for kernel in module._get_live_kernels() if kernel.key.endswith("__update")]
with patch.object(module, "_get_live_kernels", lambda: of_update):
    module.mark_modified()
    wp.compile_aot_module(module, device="cpu", module_dir=f"{sys.argv[2]}/update")
"""


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="looked at on x86 alone")
@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("case_1", {}),
        *(pytest.param(name, {}, marks=pytest.mark.slow) for name in ("case_1_mud", "case_1_mu_i", "case_1_loose")),
        pytest.param(
            "case_1_mu_i",
            {"flow.material.dilatancy": {"critical_solid_fraction": 0.56}},
            marks=pytest.mark.slow,
            id="mu_i, dilatancy",
        ),
    ],
)
def test_the_update_of_the_points_is_vectorised(load_scene, tmp_path, name, changes):
    """The compiler says so itself; one call or one branch too many and a step costs half as much again. It is given
    this kernel alone, as all of them take it four times as long."""
    (tmp_path / "scene.json").write_text(json.dumps(load_scene(name, **changes).resolved()))
    done = subprocess.run(
        [sys.executable, "-c", COMPILE, tmp_path / "scene.json", tmp_path],
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    (source,) = (tmp_path / "all").glob("*.cpp")
    # It alone has Warp's two versions, with and without gaps in the arrays: each of another kernel is for nothing.
    versions = r"__locals__(\w+)_[0-9a-f]{8}_cpu_forward_tasks<true>"
    assert set(re.findall(versions, source.read_text())) == {"update"}
    (source,) = (tmp_path / "update").glob("*.cpp")
    lines = source.read_text().splitlines()
    vectorised = set()
    for line, width in re.findall(
        r"\.cpp:(\d+):\d+: remark: vectorized loop \(vectorization width: (\d+)", done.stderr
    ):
        # The function that the line stands in: the nearest above it whose name tells the kernel.
        above = (re.search(r"__locals__(\w+)_[0-9a-f]{8}_cpu_forward_tasks\(", text) for text in lines[int(line) :: -1])
        kernel = next((match[1] for match in above if match), None)
        if int(width) >= 2:
            vectorised.add(kernel)
    assert "update" in vectorised


@pytest.mark.skipif(sys.platform == "darwin", reason="Warp comes without CUDA there")
@pytest.mark.parametrize(
    ("name", "precision"),
    [
        ("case_1", "float64"),
        pytest.param("case_1_dry", "float32", marks=pytest.mark.slow),
        pytest.param("case_1_mud", "float64", marks=pytest.mark.slow),  # a quarter of a minute each
        pytest.param("case_1_mu_i", "float64", marks=pytest.mark.slow),
        pytest.param("case_1_loose", "float64", marks=pytest.mark.slow),
    ],
)
def test_the_same_kernels_compile_for_a_gpu(load_scene, tmp_path, name, precision):
    """By NVIDIA's own compiler, which needs no GPU; whether they run there is another question."""
    effects = derive_effects(load_scene(name, **{"numerics.precision": precision}))
    kernels = build_kernels(effects)
    module = wp.get_module(effects.module_name)
    wp.compile_aot_module(module, arch=[80], module_dir=tmp_path, use_ptx=True)
    (code,) = tmp_path.glob("*.ptx")
    text = code.read_text()
    parts = re.split(r"\.entry \w*__locals__(\w+)_[0-9a-f]{8}_cuda_kernel_forward", text)
    bodies = dict(zip(parts[1::2], parts[2::2], strict=True))
    assert {"scatter", "move", "gather", "advect", "update", "bound", "tick", "press", "join"} <= set(bodies)
    assert set(bodies) <= set(kernels.__dict__)
    # Joined places: after a colour, all threads wait before they take the next, which shares nodes with it. No other
    # kernel has its threads wait for each other.
    waiting = {kernel: len(re.findall(r"\bbar(?:rier)?\.(?:cta\.)?sync\b", text)) for kernel, text in bodies.items()}
    assert waiting.pop("join") >= 9  # times that a barrier that slides makes them wait
    assert set(waiting.values()) == {0}
    # Points that share a node or a corner add to it one after the other: every sum of theirs is atomic.
    values = 4 if effects.two_phase else 2
    corner = 5 if effects.two_phase else 2
    for kernel, sums in (("scatter", 9 * (1 + values)), ("gather", 4 * corner)):
        assert len(re.findall(rf"(?:atom|red)\.\S*add\.f{precision[-2:]}", bodies[kernel])) >= sums
