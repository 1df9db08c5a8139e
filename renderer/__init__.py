"""
renderer draws one cell: no queue, no HTTP, no SQL.

Importing this package is cheap. Mitsuba is imported only inside render processes, by ``renderer.render``
and what it loads; ``spec``, ``catalog``, ``errors``, ``llvm`` and ``devices`` may be imported anywhere.
"""

__version__ = "0.1.0"
