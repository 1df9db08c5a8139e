"""What is said of every sampler of ours."""

from __future__ import annotations

CORRECT = ("poissondisk", "relaxedpoissondisk", "eliminated", "sobol", "zsobol", "pmj02bn", "halton")
POISSON = ("poissondisk", "relaxedpoissondisk", "eliminated")
NETS = ("sobol", "zsobol", "pmj02bn")
COUNTS = (16, 64, 200, 256)
