"""
jobs remembers and runs many cells: the grid, the queue, the executors, the measurements.

The only package with SQL. It knows ``renderer`` and never ``service``, and its owner process never imports Mitsuba:
what draws is a child process that may be killed at any time.
"""
