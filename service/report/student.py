"""
How unlikely a deviation is by chance, when its standard error was itself estimated from a few replicates.

With four replicates a mean lies more than 3 standard errors off in 6 of 100 cases, not in 3 of 1000: a report of many
cells would be full of false alarms. The dashboard judges by the same rule (web/views/experiment/student.js).
Abramowitz and Stegun, Handbook of Mathematical Functions, 26.7.3 and 26.7.4.
"""

from __future__ import annotations

import math


def tail(t: float, degrees: int) -> float:
    """
    Probability that Student's t with ``degrees`` (1 or more) of freedom is farther from 0 than ``t``, on either side.
    Exact up to rounding: below about 1e-15 it comes out as 0.
    """
    angle = math.atan(abs(t) / math.sqrt(degrees))
    sin, cos = math.sin(angle), math.cos(angle)
    odd = degrees % 2 == 1
    term = cos if odd else 1.0
    total = 0.0 if degrees == 1 else term
    for k in range(3 if odd else 2, degrees, 2):
        term *= (k - 1) / k * cos * cos
        total += term
    inside = 2 / math.pi * (angle + sin * total) if odd else sin * total
    return max(0.0, 1.0 - inside)
