"""
Numbers, times and lists as people read them in a report; the same value is written as on the dashboard
(web/format.js).
"""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Iterable, Sequence

from markupsafe import Markup, escape

DASH = "–"  # where there is no number


def number(value: float | None, digits: int = 3) -> str:
    """Three significant digits; small and large ones as 1.08e-2, the form in which errors are compared."""
    if value is None or math.isnan(value):
        return DASH
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    if value and not 0.1 <= abs(value) < 10 ** (digits + 1):
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    return _precision(value, digits)


def _precision(value: float, digits: int) -> str:
    """As many significant digits, never an exponent."""
    exponent = int(f"{value:.{digits - 1}e}".split("e")[1])
    return f"{value:.{max(0, digits - 1 - exponent)}f}"


def factor(value: float | None) -> str:
    """How many times as much: 0.0937, 1.30, 24.5."""
    if value is None or not 1e-4 <= value < 1e5:
        return number(value)
    return _precision(value, 3)


def ratio(value: float, error: float | None) -> tuple[str, str]:
    """A number near 1 and its spread, with as many decimals as the spread says anything about."""
    if not error:
        return f"{value:.4f}", ""
    decimals = min(7, max(2, 1 - math.floor(math.log10(error))))
    return f"{value:.{decimals}f}", f"{error:.{decimals}f}"


def quiet_exponent(text: str) -> Markup:
    """``4.87e-4`` with a fainter exponent, so that the eye runs over the digits; copied, it is the same text."""
    mantissa, e, exponent = text.partition("e")
    return Markup("{}<i>e{}</i>").format(mantissa, exponent) if e else Markup(text)


def minus(text: str) -> str:
    """With a true minus, for prose."""
    return text.replace("-", "−")


def breakable(name: str) -> Markup:
    """A label that may break where its parts meet."""
    return Markup(re.sub(r"([:,·/])", r"\1<wbr>", str(escape(name))))


def decimals(value: float) -> str:
    """A slope: two decimals, with a true minus."""
    return minus(f"{value:.2f}")


def duration(seconds: float | None) -> str:
    """The two units that matter: "850 ms", "12 s", "3 min 20 s", "2 h 5 min", "3 d 4 h"."""
    if seconds is None:
        return DASH
    if seconds < 0.0005:
        return "0 s"
    if seconds < 0.0095:
        return f"{seconds * 1000:.1f} ms"
    if seconds < 0.9995:
        return f"{seconds * 1000:.0f} ms"
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return _two(whole, 60, "min", "s")
    minutes = round(seconds / 60)
    return _two(minutes, 60, "h", "min") if minutes < 1440 else _two(round(minutes / 60), 24, "d", "h")


def _two(count: int, base: int, large: str, small: str) -> str:
    whole, rest = divmod(count, base)
    return f"{whole} {large} {rest} {small}" if rest else f"{whole} {large}"


def count(value: int) -> str:
    """Thousands with thin spaces."""
    return f"{value:,}".replace(",", "\u202f")


def counted(value: int, one: str, many: str = "") -> str:
    """ "1 cell", "3 cells"."""
    return f"{count(value)} {one if value == 1 else many or one + 's'}"


def stamp(iso: str) -> str:
    """2026-11-26 03:58, in UTC."""
    return f"{datetime.datetime.fromisoformat(iso).astimezone(datetime.UTC):%Y-%m-%d %H:%M}"


def day(iso: str) -> str:
    """26 November 2026, 03:58 UTC."""
    when = datetime.datetime.fromisoformat(iso).astimezone(datetime.UTC)
    return f"{when.day} {when:%B %Y, %H:%M} UTC"


def listed(items: Iterable[object], most: int | None = None) -> str:
    """``a, b and c``; of a longer list the first ``most`` and how many more."""
    texts = [str(item) for item in items]
    if most is not None and len(texts) > most:
        texts[most:] = [f"{len(texts) - most} more"]
    return joined(texts)


def joined(texts: Sequence[str]) -> str:
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)
