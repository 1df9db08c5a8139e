"""
One process, one Mitsuba variant.

A variant is process-wide state, so only render processes call ``use``, once, before anything else of
Mitsuba is touched. ``name`` needs no Mitsuba and is what the owner uses to decide which process a cell needs.
"""

from __future__ import annotations

from renderer.catalog import COLOURS
from renderer.errors import BadParameter

BACKENDS = ("llvm", "cuda")


def name(backend: str, colour: str) -> str:
    """
    Mitsuba's name of the variant, e.g. ``llvm_ad_rgb``.

    Raises ``BadParameter`` for a colour mode we do not render: polarized ones among them, because errors of
    Stokes vectors are no errors of pictures.
    """
    if colour not in COLOURS or backend not in BACKENDS:
        raise BadParameter(f"colour = {colour!r} cannot be rendered; it is one of {', '.join(COLOURS)}")
    return f"{backend}_ad_{colour}"


def use(variant: str, threads: int | None = None) -> None:
    """
    Make ``variant`` this process's own, with ``threads`` worker threads (default: one a core).

    Our plugins are registered. Mitsuba's log is cut down to errors. Raises ``ImportError`` where the backend's library
    is missing.
    """
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)  # a sampler that rounds warns; the catalog has said so already
    if threads is not None:
        dr.set_thread_count(threads)
    from renderer.plugins import register_all  # they derive from the variant's classes

    register_all()
