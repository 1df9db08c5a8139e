"""
service shows and accepts: the command line, and the server's routes and reports. No pixels, no SQL.

It knows ``jobs`` and the Mitsuba-free modules of ``renderer`` (``spec``, ``catalog``, ``errors``,
``scenes.sources``, ``images``, ``metrics``, ``llvm``, ``devices``).
"""
