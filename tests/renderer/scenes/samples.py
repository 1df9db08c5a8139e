"""Pieces of scene files that several tests use."""

from __future__ import annotations

TRIANGLE = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""
SPECTRUM = "400 0.1\n550 0.5\n700 0.3\n"
SPHERE = '<shape type="sphere"/>'
MESH = '<shape type="ply"><string name="filename" value="{}"/></shape>'
SENSOR = '<sensor type="perspective"><float name="fov" value="40"/></sensor>'


def xml(body: str) -> str:
    """A whole scene file."""
    return f'<scene version="3.0.0">\n{body}\n</scene>\n'
