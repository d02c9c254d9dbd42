"""Compiled kernels in Warp's cache: built anew where they are broken, and elsewhere where it cannot be written to."""

from __future__ import annotations

import contextlib
import logging
import shutil
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import warp as wp

from analytic.whole_file import UnwrittenError

from ..loading import no_garbage

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_log = logging.getLogger("warp_mpm")


class KernelCacheError(UnwrittenError):
    """Compiled kernels can be put nowhere; one sentence."""

    def __str__(self) -> str:
        return (
            f"Compiled kernels cannot be written to {self.filename}: {self.strerror}; WARP_CACHE_PATH=FOLDER names "
            "another place."
        )


def initialize_warp() -> None:
    """`wp.init`, also where the cache of compiled kernels cannot be made.

    Raises:
        KernelCacheError: no other place can be had either.
    """
    try:
        wp.init()
    except OSError as error:
        _go_elsewhere(error)
        wp.init()


@no_garbage()
def load_kernels(module_name: str, device: Any) -> None:
    """Compile the kernels of a module, or find them compiled.

    What is broken in the cache (a process was killed, a disk was full) is built anew; where the cache takes nothing,
    kernels are compiled into a temporary folder, for this process alone. Either is told on standard error.

    Raises:
        KernelCacheError: compiled kernels can be put nowhere.
        Exception: whatever Warp raises where they cannot be compiled.
    """
    try:
        _load(module_name, device)
        return
    except MemoryError:
        raise
    except Exception as error:  # of a broken object Warp raises Exception itself
        problem = error
    if _takes_files(wp.config.kernel_cache_dir):
        for folder in _folders(module_name):
            _log.warning("Compiled kernels in %s are broken or were not written; they are built anew.", folder)
            shutil.rmtree(folder, ignore_errors=True)
        try:
            _load(module_name, device, again=True)
            return
        except Exception as error:
            problem = error
    _go_elsewhere(problem)
    try:
        _load(module_name, device, again=True)
    except OSError as error:
        raise _unwritten(error) from None


def _load(module_name: str, device: Any, *, again: bool = False) -> None:
    module = wp.get_module(module_name)
    if again:
        module.mark_modified()  # forgets the failure before, which Warp would repeat
    with _one_at_a_time(module, device):
        wp.load_module(module, device=device)
    # An object with a hole in it, which a crash of the machine may leave, can load and lack kernels.
    for execution in module.execs.values():
        for kernel in module.kernels.values():
            if execution.get_kernel_hooks(kernel).forward is None:
                module.execs.clear()
                raise RuntimeError(f"{kernel.key} is missing in the compiled kernels of {module_name}")


@contextlib.contextmanager
def _one_at_a_time(module: Any, device: Any) -> Iterator[None]:
    """Of several processes that need the same kernels one compiles them; the others wait for it, and take what it made.

    Where there are no locks each compiles its own.
    """
    folder = Path(wp.config.kernel_cache_dir) / module.get_module_identifier(
        1 if wp.get_device(device).is_cpu else None
    )
    if fcntl is None or folder.exists():
        yield
        return
    with contextlib.ExitStack() as stack:
        path = folder.with_name(f"{folder.name}.lock")
        with contextlib.suppress(OSError):  # if nothing can be written there, loading will tell
            file = stack.enter_context(path.open("w"))
            stack.callback(path.unlink, missing_ok=True)
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _folders(module_name: str) -> list[Path]:
    """What the cache holds of a module."""
    module, place = wp.get_module(module_name), Path(wp.config.kernel_cache_dir)
    folders = {place / module.get_module_identifier(block) for block in module.hashers}
    return [folder for folder in folders if folder.exists()]


def _takes_files(place: str) -> bool:
    try:
        with tempfile.TemporaryFile(dir=place) as file:
            file.write(b"0")
    except OSError:
        return False
    return True


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    """Gone at the end of the process."""
    return tempfile.TemporaryDirectory(prefix="warp_mpm_kernels_", ignore_cleanup_errors=True)


def _go_elsewhere(problem: Exception) -> None:
    """Let kernels be compiled into a temporary folder, unless they were and that failed with this problem."""
    before = wp.config.kernel_cache_dir
    try:
        place = _temporary().name
    except OSError:
        raise _unwritten(problem) from None
    if before == place:
        raise _unwritten(problem) from None
    reason = getattr(problem, "strerror", None) or problem
    _log.warning(
        "Compiled kernels cannot be kept in %s (%s): they are compiled for this process alone; WARP_CACHE_PATH=FOLDER "
        "names another place.",
        before,
        reason,
    )
    wp.config.kernel_cache_dir = place


def _unwritten(problem: Exception) -> Exception:
    if isinstance(problem, OSError):
        return KernelCacheError(problem.errno, problem.strerror or str(problem), wp.config.kernel_cache_dir)
    return problem
