"""Words of Siemens controls by what the reader does with them."""

from __future__ import annotations

from verify.assumptions import Assumed, AssumedKind
from verify.gcode.cutter_compensation import Approach, Corner, Style
from verify.gcode.dialects.base import BlockError

SIEMENS_STYLE = Style(Corner.ARC, Approach.NEXT_NORMAL)
"""NORM and G450."""
SHARP_STYLE = Style(Corner.INTERSECTION, Approach.NEXT_NORMAL)
"""NORM and G451."""

SAME = frozenset({0, 1, 2, 3, 17, 18, 19, 40, 53, 54, 55, 56, 57, 90, 91, 93, 94, 95})
"""G words that the reader takes as they are."""
UNITS = {700: 20, 710: 21, 71: 21}
UNBOUNDED = frozenset({64, 642, 643, 644, 645})
IDLE_CODES = frozenset({9, 62, 290, 601, 602, 603, 621, 810, 820, 971})
"""G words without effect on a path: exact stops, feeds in corners, groups of the machine's maker."""


def _named(meaning: str, words: str) -> dict[str, str]:
    return dict.fromkeys(words.split(), meaning)


_SOFT = "a soft approach or retract"
MOVES = {5: "an oblique plunge", 7: "an oblique plunge", 33: "thread cutting", 34: "thread cutting",
         35: "thread cutting",
         58: "a programmable work offset", 59: "a programmable work offset",
         96: "constant cutting speed", 962: "constant cutting speed",
         **dict.fromkeys((147, 148, 247, 248, 340, 341, 347, 348), _SOFT),
         **dict.fromkeys((460, 461, 462), "a longer approach of cutter radius compensation")}
"""G words that are not followed, and what they do."""

IDLE = frozenset("""
    ACTBLOCNO BLSYNC BRISK CDOF CDOF2 CDON CORROF CP CPRECOF CPRECON CUT2D CUT2DF
    DELAYFSTOF DELAYFSTON DIAMOF DISPLOF DISPLON DRIVE DYNFINISH DYNNORM DYNPOS DYNPREC DYNROUGH
    DYNSEMIFIN FFWOF FFWON FIFOCTRL FNORM FTOCOF GWPSOF IPTRLOCK IPTRUNLOCK NORM OSC OSD OSOF
    OSS OSSE OST PAROTOF RTLION SAVE SBLOF SBLON SOFT SPATH SPCOF SPCON STARTFIFO STOPFIFO STOPRE SUPD
    TOROTOF TOWSTD UPATH WALIMOF WALIMON""".split())
"""Words that change speed, smoothing, display or the flow of blocks only."""

SMOOTHS: dict[str, tuple[str, bool]] = {
    "ORISON": ("ORISON", True), "ORISOF": ("ORISON", False), "COMPOF": ("COMPRESS", False)}
"""Words that begin or end a smoothing of the tool axis, its name and whether they begin it."""

CONTOUR_FEED = "CFC"
"""The word that makes F the feed of a compensated contour on arcs, as delivered (MD20150)."""

FEEDS = frozenset({CONTOUR_FEED, "CFTCP", "CFIN"})
"""Words of its group: CFTCP and CFIN leave F to the centre of the tool, on outside arcs at least."""

COMPRESSORS = frozenset({"COMPON", "COMPCURV", "COMPCAD", "COMPSURF"})
"""Words after which the control may leave the path, by CTOL where it is stated."""

IDLE_VALUES = frozenset("""
    ACC ACCLIMA FGREF FL H JERKLIM JERKLIMA OVRA OVRRAP SPOS SPOSA STOLF VELOLIM
    VELOLIMA""".split())
"""Names with a value that change speed, smoothing or outputs only."""

_AXES = frozenset("XYZABC")
DEGREE_IS_MM = 57.2957
"""mm, FGREF of a rotary axis at which one degree counts as 1 mm: as delivered."""

IDLE_CALLS = frozenset("""
    BRISKA CLRINT DELETE DISABLE DRIVEA ENABLE FGREF FGROUP GROUP_ADDEND GROUP_BEGIN GROUP_END MSG NEWCONF
    SETMS SOFTA SPCOF SPCON SPI WAITP WORKPIECE WRITE""".split())
"""Calls without a move: lines on the screen, the blank of the graphics, limits of speed."""

VALUES = frozenset("""
    A1 A3 ADIS ADISPOS AP AR ATOL B1 B3 C1 C3 CHF CHR CR CTOL FB FP FRC FRCM I1 J1 K1 OTOL RND RNDM RP RPL TURN X1 Y1
    Z1""".split())
"""Names with a value that belong to the move of their block."""

NOT_FOLLOWED = {
    **_named("a pocket", "POCKET1 POCKET2 POCKET3 POCKET4 CYCLE73"), **_named("slots on a circle", "SLOT1 SLOT2"),
    **_named("elongated holes", "LONGHOLE"), **_named("engraving", "CYCLE60"), **_named("face milling",
                                                                                        "CYCLE61 CYCLE71"),
    **_named("a contour", "CYCLE62 CYCLE63 CYCLE64 CYCLE72 CYCLE74 CYCLE75"),
    **_named("thread milling", "CYCLE70 CYCLE78 CYCLE90"), **_named("a spigot", "CYCLE76 CYCLE77 CYCLE79"),
    **_named("a pattern of holes", "CYCLE801 CYCLE802 HOLES3"), **_named("an open slot", "CYCLE899"),
    **_named("turning", "CYCLE92 CYCLE93 CYCLE94 CYCLE95 CYCLE930 CYCLE940 CYCLE951 CYCLE952"),
    **_named("a thread", "CYCLE97 CYCLE98 CYCLE99"),
    **_named("a measurement", "CYCLE750 CYCLE971 CYCLE976 CYCLE977 CYCLE978 CYCLE979 CYCLE996 CYCLE998"),
    **_named("another transformation", "TRANSMIT TRACYL TRAANG"), **_named("a tangential axis", "TANG TANGON TANGOF"),
    **_named("a coupled axis", "TRAILON LEADON COUPON"), **_named("travel to a stop", "FXS"),
    **_named("a preset axis", "PRESETON PRESETONS"), **_named("a contour table", "EXECTAB CONTPRON CONTDCON"),
    **_named("a wait for another channel", "INIT START WAITE WAITM WAITMC"), **_named("a tool offset", "TOFFON"),
}
"""Cycles and functions that move, turn or cut and are not followed, and what they do."""

REFUSED = {
    **_named("X by the diameter", "DIAMON DIAM90"),
    **_named("a spline", "ASPLINE BSPLINE CSPLINE"), **_named("a polynomial", "POLY PO"),
    **_named("an involute", "INVCW INVCCW"),
    **_named("another approach of cutter radius compensation", "KONT KONTT KONTC"), **_named("an allowance", "OFFN"),
    **_named("a frame from the tool or the part", "TOFRAME TOROT PAROT"),
    **_named("a rotation by solid angles", "ROTS AROTS CROTS"), **_named("a frame variable",
                                                                         "CTRANS CROT CSCALE CMIRROR"),
    **_named("a measurement", "MEAS MEAW MEASA"), **_named("compensation in space", "CUT3DC CUT3DF CUT3DFS CUT3DFF"),
    **_named("a tool carrier", "TCARR TCOABS TCOFR TOWWCS"), **_named("suppressed compensation", "CUTCONON"),
    **_named("travel to a stop", "FXS"), **_named("moves of the axes", "PTP PTPG0"),
    **_named("orientation on a curve or cone", "ORICURVE ORICONCW ORICONCCW ORICONIO"),
    **_named("other orientation angles", "ORIEULER ORIRPY ORIRPY2 ORIVIRT1 ORIVIRT2 A2 B2 C2"),
    **_named("a move of the machine's maker", "OEMIPO1 OEMIPO2"),
    **_named("an angle of a line", "ANG"), **_named("surface normals",
                                                                                      "A4 B4 C4 A5 B5 C5"),
    **_named("a lead or tilt angle", "LEAD TILT"), **_named("a turn of the tool about itself", "THETA"),
    **_named("a feed that changes along its move", "FLIN FCUB FPO"),
    **_named("a limit of the spindle speed", "LIMS"), **_named("a feed per tooth", "FZ"),
    **_named("a cutting rate", "SVC"), **_named(_SOFT, "DISR DISCL"),
    **_named("another transformation", "TRACON TRANSMIT TRACYL TRAANG"),
    **_named("a positioning axis", "POS POSA POSP"), **_named("a turn of the tool", "ORIRESET"),
    **_named("coordinates that count as diameters", "DIAMCHANA"),
}
"""Words and names that move or cut and are not followed, and what they are."""


LENGTH_BY_PLANE = Assumed(AssumedKind.LENGTH_AXIS, "Z in the planes G18 and G19 too", "where setting data 42940 is 0, "
                          "the length of a mill counts in Y in G18 and in X in G19, and the tool goes down by it",
                          "program G17, or set SD42940 $SC_TOOL_LENGTH_CONST to 17 on the machine")
"""What a program leaves open that changes the plane while a length offset is on."""


def check_limit(name: str, index: str, value: float | str) -> None:
    """Refuse a limit or factor NAME[index] = value that changes what F or S of the program mean.

    Raises
    ------
    BlockError
        FGREF below ``DEGREE_IS_MM``, or a factor of the speed of a spindle.
    """
    if name == "FGREF" and isinstance(value, float) and value < DEGREE_IS_MM:
        raise BlockError(f"FGREF[ ]={value:g} is not followed: a rotary axis turns faster than the degrees of F",
                         "leave FGREF as it is")
    if name in ("OVRA", "VELOLIM") and index.strip("[] =") not in _AXES:
        raise BlockError(f"{name}{index.strip('= ')} is not followed: it may slow the spindle down", "program S")


def factor_of_feeds(percent: float) -> float:
    """Factor of path feeds that OVR= states.

    Raises
    ------
    BlockError
        The percentage is not in the range of the control.
    """
    if not 0.0 < percent <= 200.0:
        raise BlockError(f"OVR={percent:g} is not above 0 and up to 200")
    return percent / 100.0


__all__ = ["COMPRESSORS", "CONTOUR_FEED", "FEEDS", "IDLE", "IDLE_CALLS", "IDLE_CODES", "IDLE_VALUES",
           "LENGTH_BY_PLANE", "MOVES", "NOT_FOLLOWED", "REFUSED", "SAME", "SHARP_STYLE", "SIEMENS_STYLE", "SMOOTHS",
           "UNBOUNDED", "UNITS", "VALUES", "check_limit", "factor_of_feeds"]
