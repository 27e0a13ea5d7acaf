"""What a case may hold that the contract's catalogue does not, and why no effect or class expresses it."""

from __future__ import annotations

REASONS = {
    "hidden_ambient": "a factor that has a bump over the ambient temperature: thermal effects of the"
    " catalogue are straight lines, and additive on a channel or driven by the tread",
    "hidden_resonance": "a lightly damped second mass, which rings after what excites it: the catalogue has"
    " first-order lags and forces of the present position and velocity",
    "hidden_line": "a vibration locked to time and slowly detuned: the catalogue's lines are locked to a"
    " revolution or to a position",
    "hidden_pulse": "something touches the frame for a while in some runs: the catalogue's offsets hold over"
    " whole runs",
    "hidden_slip": "a clamp that gives way in the middle of a run and is set right later: the catalogue has"
    " no jumps in time",
    "hidden_detent": "a latch at one place of the path, which is integrated from the velocity: the"
    " catalogue's forces of position are a cubic and a sine",
    "hidden_gust": "a push that comes and goes in some runs: the catalogue's forces are constant or depend on"
    " the motion",
    "hidden_hatch": "a second outlet that stands open for a while in some runs: the catalogue has no jumps in"
    " time",
    "hidden_radiation": "heat between two bodies with the fourth power of their temperatures, which the"
    " model does not connect",
    "hidden_mass": "an unknown body that hangs on the middle one: another state of the plant",
    "hidden_tare": "the program takes another zero at every load of every file: no record and no offset of a"
    " whole recording gives that",
}

LARGEST_SHARE = 1 / 3
"""Of its energy after the nominal projection, that one catalogue effect, free in every run, may take."""
ONE_SIDED = ("saturation", "overflow", "dead_band", "coulomb_friction", "viscous_damping", "quadratic_drag")
"""Effects that only take, never give."""
