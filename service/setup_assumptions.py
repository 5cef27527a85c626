"""What a proof takes for granted because the setup leaves it open."""

from __future__ import annotations

from service.stages.job_inputs import JobInputs
from service.verification.rotary_sense import assumed_sense
from verify.assumptions import Assumed, AssumedKind


def setup_assumptions(inputs: JobInputs) -> tuple[Assumed, ...]:
    """The assumptions about machine and tools, in the order of a report."""
    machine, out = inputs.machine, []
    if machine.travel_mm is None:
        out.append(Assumed(AssumedKind.TRAVEL, "long enough", "a move may run into the end of an axis",
                           "state machine.travel_mm"))
    if open_rpm := [t.id for t in inputs.tools if machine.max_rpm is None and t.max_rpm is None]:
        out.append(Assumed(AssumedKind.MAX_RPM, "fast enough",
                           f"{', '.join(open_rpm)} may turn faster than spindle or tool allow",
                           "state machine.max_rpm, or max_rpm of each tool"))
    if inputs.material.specific_cutting_force_n_mm2 is None:
        out.append(Assumed(AssumedKind.CUTTING_FORCE, "small enough", "a tool may break or bend in a deep cut: the "
                           f"proof knows no cutting force of {inputs.material.name}",
                           "state specific_cutting_force_n_mm2 and chip_thickness_exponent of the material"))
    if inputs.material.group is not None:
        out.append(Assumed(AssumedKind.CUTTING_FORCE, f"typical of {inputs.material.group}",
                           f"{inputs.material.name} has no figures of its own: it may need more force, or a lower "
                           "speed or feed, than its group", "give material as an object with its cutting data"))
    return tuple(out)


def planned_sense(inputs: JobInputs) -> tuple[Assumed, ...]:
    """The sense of the table axes that a plan has taken, where the setup leaves it open."""
    machine = inputs.kinematics
    if machine is None or inputs.machine.iso_axes is not None or not machine.table_letters:
        return ()
    return (assumed_sense(machine, "as the programs say"),)


__all__ = ["planned_sense", "setup_assumptions"]
