"""
Inlining: scripts, styles and data inside one HTML file, so that none of them can end its own element.

Scripts are the dashboard's own files; an import between two of them is dropped, because they share one scope here.
"""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

from markupsafe import Markup

WEB = Path(__file__).resolve().parents[2] / "web"
HERE = Path(__file__).resolve().parent

_IMPORT = re.compile(r"^import\b[^;]*;\n", re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?function|const|class)", re.MULTILINE)
# What ends a script, or makes the parser look for another end (HTML, 13.2.5.15 to 13.2.5.31).
_ENDS = re.compile(r"<(?=/script|script|!--)", re.IGNORECASE)


def script(*files: Path) -> Markup:
    """Scripts in one scope of their own. A ``<`` that would end the element is written as an escape of strings."""
    modules = "\n".join(_EXPORT.sub("", _IMPORT.sub("", file.read_text("utf-8"))) for file in files)
    return Markup(_ENDS.sub(r"\\x3c", f'"use strict";\n(() => {{\n{modules}}})();'))


def library(file: Path) -> Markup:
    """A script as it is, in the global scope."""
    return Markup(_ENDS.sub(r"\\x3c", file.read_text("utf-8")))


def data(value: Any) -> Markup:
    """JSON for a ``<script type="application/json">``: without any ``<``, so nothing in it is markup."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return Markup(text.replace("<", "\\u003c"))


def style(*files: Path) -> Markup:
    """Style sheets, later ones over earlier ones."""
    return Markup("\n".join(file.read_text("utf-8") for file in files).replace("</", "<\\/"))


def icon() -> str:
    """The dashboard's icon as a data URI: a browser that looks for one asks nobody."""
    return "data:image/svg+xml;base64," + base64.b64encode((WEB / "icon.svg").read_bytes()).decode()
