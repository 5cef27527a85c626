"""Kinds of tools in the words of libraries."""

from __future__ import annotations

import re

AUTODESK = {
    "flat end mill": "flat", "ball end mill": "ball", "bull nose end mill": "bull", "tapered mill": "tapered",
    "face mill": "mill", "drill": "drill", "spot drill": "drill", "chamfer mill": "chamfer", "engraving": "chamfer",
    "tap right hand": "tap", "thread mill": "thread_mill", "end mill": "mill",
    "circle segment lens": "lens", "circle segment oval": "barrel", "circle segment taper": "barrel",
    "circle segment barrel": "barrel"}
"""Kinds of Fusion and HSMWorks that a tool has; all others are left out."""
TO_AUTODESK = {
    "flat": "flat end mill", "ball": "ball end mill", "bull": "bull nose end mill", "tapered_flat": "tapered mill",
    "tapered_ball": "tapered mill", "tapered_bull": "tapered mill", "drill": "drill", "chamfer": "chamfer mill",
    "tap": "tap right hand", "thread_mill": "thread mill", "lens": "circle segment lens"}
SEGMENTS = {"circle segment lens": ("RE", "lower-radius"), "circle segment oval": ("lower-radius", "profile-radius")}
"""Kinds of Fusion whose outline a lens or barrel of a setup has: names of the corner radius and of the large one."""
_NOT_AVAILABLE = re.compile(r"lolli?pop|barrel|tonnen|t-?slot|t-?nut|dovetail|schwalben|woodruff|undercut|form mill|"
                            r"radius mill|concave|corner round|viertelkreis")
_WORDS = (
    (r"gewindefr|thread ?-?mill", "thread_mill"),
    (r"tap ?drill|kernloch", "drill"),
    (r"gewindebohr|\btap\b|\btaps\b", "tap"),
    (r"chamfer|fasfr|fasen|v-?bit|entgrat|engrav", "chamfer"),
    (r"\bdrill|spot|bohrer", "drill"),
    (r"taper|konisch|conical", "tapered"),
    (r"ball|kugel|vollradius|full radius", "ball"),
    (r"bull|torus|toroid|corner rad|eckenrad|radiused", "bull"),
    (r"end ?-?mill|mill|schaftfr|langloch|nutenfr|fr(ä|ae)ser|flat", "mill"),
)


def kind_of_words(text: str) -> str:
    """Kind that a description names, '' where it names none or one that is not available.

    >>> kind_of_words("ENDMILL H1TE 1/16"), kind_of_words("VHM Kugelfräser R3"), kind_of_words("#7 tap drill")
    ('mill', 'ball', 'drill')
    >>> kind_of_words("lollipop mill"), kind_of_words("probe")
    ('', '')
    """
    words = text.casefold()
    if _NOT_AVAILABLE.search(words):
        return ""
    return next((kind for pattern, kind in _WORDS if re.search(pattern, words)), "")
