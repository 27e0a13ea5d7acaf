"""Relaxation length: the distance over which the side force follows the steered slip angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.characteristics.characteristic import SWEEP_BUDGET, TRANSIENT, Characteristic, Figure, Need
from toolkit.characteristics.sweep_length import parts_delay, relaxation_length
from toolkit.characteristics.uncertain import Uncertain

if TYPE_CHECKING:
    from toolkit.characteristics.reading import Reader


def length(_declared: Characteristic, run: Reader) -> Uncertain | None:
    """Return the relaxation length of one direction at its load [m]."""
    group, shared = run.group, run.shared
    return relaxation_length(
        run.direction.sweeps,
        load_N=group.load_N,
        owner=shared.machine,
        test=f"{shared.test}/{group.load_N:.6g}/{group.rotation}",
    )


CHARACTERISTIC = Characteristic(
    name="relaxation_length",
    symbol="sigma",
    title="relaxation length",
    definition=(
        "Distance that the tire rolls until its side force has followed a small change of the steered slip "
        "angle, in the mean of its answer; turn slip while steering is part of it, a delay of the channels "
        "is not."
    ),
    formula="sigma/V dFY/dt + FY = FY_steady(SA), less V times the delay of FY behind SA",
    term="relaxation length",
    source="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 7.1",
    channel="FY",
    unit="m",
    digits=0,
    order=6,
    table=TRANSIENT,
    read=length,
    needs=(
        Need(
            text="no recording in time whose steering shows it: name one under [sweeps] of test.toml",
            met=lambda direction: bool(direction.sweeps),
        ),
        Need(
            text="one speed and no stated delay: a length and a delay of the channel are not parted",
            met=lambda direction: parts_delay(direction.sweeps),
        ),
    ),
    budget=SWEEP_BUDGET,
    column_text="distance over which FY follows the steered slip angle",
    figure=Figure(name="relaxation_length", title="relaxation length", text="relaxation length against load"),
    label="of sweeps in time",
    compared=True,
    console_heading="sigma",
    comparison_figure=Figure(name="relaxation_length", title="relaxation length"),
)
