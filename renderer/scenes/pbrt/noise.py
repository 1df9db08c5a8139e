"""
Perlin's gradient noise, for pbrt's ``dots``: it decides which cells have a dot, and where in the cell.

Source: Perlin, "Improving Noise" (2002): the permutation, the fade curve and the sixteen gradients.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_TABLE = """
151 160 137 91 90 15 131 13 201 95 96 53 194 233 7 225 140 36 103 30 69 142 8 99 37 240 21 10 23 190 6 148 247
120 234 75 0 26 197 62 94 252 219 203 117 35 11 32 57 177 33 88 237 149 56 87 174 20 125 136 171 168 68 175 74
165 71 134 139 48 27 166 77 146 158 231 83 111 229 122 60 211 133 230 220 105 92 41 55 46 245 40 244 102 143 54
65 25 63 161 1 216 80 73 209 76 132 187 208 89 18 169 200 196 135 130 116 188 159 86 164 100 109 198 173 186 3
64 52 217 226 250 124 123 5 202 38 147 118 126 255 82 85 212 207 206 59 227 47 16 58 17 182 189 28 42 223 183
170 213 119 248 152 2 44 154 163 70 221 153 101 155 167 43 172 9 129 22 39 253 19 98 108 110 79 113 224 232 178
185 112 104 218 246 97 228 251 34 242 193 238 210 144 12 191 179 162 241 81 51 145 235 249 14 239 107 49 192 214
31 181 199 106 157 184 84 204 176 115 121 50 45 127 4 150 254 138 236 205 93 222 114 67 29 24 72 243 141 128 195
78 66 215 61 156 180
"""
_PERMUTATION = np.array(_TABLE.split(), np.int64)


def noise(x: Floats, y: Floats) -> Floats:
    """Noise in [-1, 1] at (x, y, 1/2)."""
    corner = [np.floor(axis).astype(np.int64) for axis in (x, y)]
    dx, dy = x - corner[0], y - corner[1]
    wx, wy = _fade(dx), _fade(dy)
    total = np.zeros_like(dx)
    for i in (0, 1):
        for j in (0, 1):
            for k in (0, 1):  # z = 1/2: both of its corners weigh the same
                at = _hash(corner[0] + i, corner[1] + j, k)
                weight = (wx if i else 1 - wx) * (wy if j else 1 - wy) * 0.5
                total += weight * _gradient(at, dx - i, dy - j, 0.5 - k)
    return total


def _fade(t: Floats) -> Floats:
    return t**3 * (t * (6 * t - 15) + 10)


def _hash(i: NDArray[np.int64], j: NDArray[np.int64], k: int) -> NDArray[np.int64]:
    row = _PERMUTATION[(_PERMUTATION[i & 255] + j) & 255]
    return _PERMUTATION[(row + k) & 255] & 15


def _gradient(at: NDArray[np.int64], dx: Floats, dy: Floats, dz: float) -> Floats:
    """The dot product with one of the edge directions of a cube."""
    first = np.where((at < 8) | (at == 12) | (at == 13), dx, dy)
    second = np.where((at < 4) | (at == 12) | (at == 13), dy, dz)
    return np.where(at & 1, -first, first) + np.where(at & 2, -second, second)
