"""What tool, material and machine say about cutting, and cautions where a program exceeds it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CuttingWords:
    """Cutting data of one tool in the material of the setup; None: the setup says nothing.

    flutes      : count of teeth
    speed       : m/min, recommended cutting speed
    per_tooth   : mm, recommended feed per tooth
    section     : mm², recommended depth times width of a cut
    bend        : mm, largest deflection of the tip in a cut
    kc, mc      : specific cutting force of the material, N/mm², and its exponent
    rpm, feed, plunge_feed, life : 1/min, mm/min, mm/min and minutes in the cut, as the tool states them
    coolant     : whether the tool is to be cooled
    pitch       : mm, of a tap or thread mill, as the tool states it
    power       : kW of the spindle, as the machine states it
    flutes_given : whether the setup states how long the flutes are
    """

    flutes: int
    speed: float
    per_tooth: float
    section: float
    bend: float
    kc: float | None = None
    mc: float | None = None
    rpm: float | None = None
    feed: float | None = None
    plunge_feed: float | None = None
    life: float | None = None
    coolant: bool | None = None
    pitch: float | None = None
    power: float | None = None
    flutes_given: bool = True


@dataclass(frozen=True)
class ProgramCaution:
    """A program exceeds what tool or material recommend. It is no finding.

    kind : 'tool_data', 'chip_load', 'cutting_speed', 'depth_of_cut', 'deflection', 'power', 'plunge_feed', 'dwell' or
           'coolant'
    tool : T number; program, line : where it is worst
    measured, limit : in the unit of the message
    """

    kind: str
    tool: int
    program: str
    line: int
    message: str
    measured: float
    limit: float
    remedy: str


__all__ = ["CuttingWords", "ProgramCaution"]
