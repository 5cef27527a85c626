"""The shares of the allowed scallop and of the chordal tolerance that each part of a finish may use.

What a sample keeps after finishing is a sum: the cusp between two passes, the lift of the tool off the part, the chords
of the passes, and the rounding of the program. Each part plans with its own share, so that the sum stays within what
the setup allows. Shares of envelopes that are measured afterwards may be larger, since rest passes follow where a
measured residual is too high.
"""

from __future__ import annotations

from dataclasses import dataclass

LAID_SHARE = 0.8  # of the scallop, for passes whose envelope is measured; chords, facets and program take the rest
CUSP_SHARE = 0.68  # of the scallop, for the distance between level passes; reach and chord take the rest
PASS_SHARE = 0.85  # of the scallop: a sample with less left is done
REACH_SHARE = 0.1  # of the scallop: lift of the tool off the part
CHORD_SHARE = 0.5  # of the chordal tolerance: chords between the locations of a pass
ROUNDING_SHARE = 0.25  # of the chordal tolerance: error of leaving out poses of a tilted tool
TIPS_SHARE = 0.5  # of the chord of a pass: chords of the way of the tip; leaving out points takes the other half
LEAD_SHARE = 0.5  # of the chord of a pass: chords of the arcs that lead onto it
SWING_SHARE = 0.1  # of the chord of a pass: what turning between two locations adds
ARC_SHARE = 0.5
"""Share of the chordal tolerance that arcs and longer lines may deviate from the planned path. The planner gets the
rest. It spends half of its share on the points it leaves out, so noise of the plan does not split an arc."""
PROGRAM_SHARE = 0.5  # of the chordal tolerance: rounding of corners by the control, and blocks of a joint program


@dataclass(frozen=True)
class ScallopBudget:
    """The heights that parts of a finish may use, mm.

    scallop_height    : mm, allowed along the normal of the surface
    chordal_tolerance : mm, allowed between the path and the surface of tool tips
    """

    scallop_height: float
    chordal_tolerance: float

    @property
    def laid(self) -> float:
        """Scallop that passes are laid for where their envelope is measured, mm."""
        return LAID_SHARE * self.scallop_height

    @property
    def cusp(self) -> float:
        """Scallop that level passes are laid for, mm."""
        return CUSP_SHARE * self.scallop_height

    @property
    def done(self) -> float:
        """Residual up to which a sample needs no further pass, mm."""
        return PASS_SHARE * self.scallop_height

    @property
    def reach(self) -> float:
        """Lift of the tool off the part, mm."""
        return REACH_SHARE * self.scallop_height

    @property
    def chord(self) -> float:
        """Chords between the locations of a pass, mm."""
        return CHORD_SHARE * self.chordal_tolerance

    @property
    def rounding(self) -> float:
        """Error of leaving out poses of a tilted tool, mm."""
        return ROUNDING_SHARE * self.chordal_tolerance

    @property
    def arcs(self) -> float:
        """Deviation of arcs and longer lines from the planned path, mm."""
        return ARC_SHARE * self.chordal_tolerance

    @property
    def program(self) -> float:
        """Rounding of corners by the control, and deviation of the blocks of a joint program, mm."""
        return PROGRAM_SHARE * self.chordal_tolerance
