"""Axis systems: half turns that undo themselves, and the signs that the books print."""

import itertools

import pytest

from toolkit.channels import AXES, CHANNELS, ROTATIONS, channel_of, signs
from toolkit.units import unit


@pytest.mark.parametrize(("one", "other"), list(itertools.product(AXES, AXES)))
@pytest.mark.parametrize("rotation", ROTATIONS)
def test_there_and_back(one: str, other: str, rotation: str) -> None:
    there, back = signs(one, other, rotation), signs(other, one, rotation)
    assert {k: there[k] * back[k] for k in there} == {"SA": 1, "FY": 1, "MZ": 1}


@pytest.mark.parametrize(
    ("axes", "FY_at_positive_SA", "MZ_at_positive_SA"),
    [("SAE", -1, 1), ("adapted-SAE", 1, -1), ("ISO-W", -1, 1)],
)
def test_a_tire_that_resists_slip(axes: str, FY_at_positive_SA: int, MZ_at_positive_SA: int) -> None:
    # SAE J670: a positive slip angle gives a negative lateral force and, by the trail, a positive moment.
    # Pacejka (2012) fig. 1.3: adapted SAE has FY > 0 and MZ < 0; ISO 8855 W: FY < 0, MZ > 0.
    sign = signs("SAE", axes)
    assert -1 * sign["FY"] * sign["SA"] == FY_at_positive_SA
    assert +1 * sign["MZ"] * sign["SA"] == MZ_at_positive_SA


def test_reversed_drum_in_machine_axes() -> None:
    # The contract's words: FY(SA) = -FY_forward(SA), MZ(SA) = +MZ_forward(SA).
    assert signs("SAE", "machine", "reverse") == {"SA": 1, "FY": -1, "MZ": 1}
    assert signs("SAE", "machine", "forward") == {"SA": 1, "FY": 1, "MZ": 1}


def test_unknown_axes() -> None:
    with pytest.raises(ValueError, match="unknown axis system"):
        signs("SAE", "JASO")  # type: ignore[arg-type]


def test_each_channel_names_an_si_unit_of_its_dimension() -> None:
    for channel in CHANNELS.values():
        assert unit(channel.si).factor == 1.0
        assert unit(channel.si).dimension == channel.dimension


@pytest.mark.parametrize(
    ("text", "symbol"),
    [
        ("t", "t"),
        ("T", "T"),
        (" T ", "T"),
        ("Time", "t"),
        ("TEMPERATURE", "T"),
        ("sa", "SA"),
        ("Slip  angle", "SA"),
        ("Fz load", "FZ"),
        ("p", "P"),
    ],
)
def test_a_channel_is_known_by_symbol_name_and_alias(text, symbol):
    assert channel_of(text) is CHANNELS[symbol]


@pytest.mark.parametrize("text", ["", "load", "angle", "SA2"])
def test_what_no_channel_is_called_is_none(text):
    assert channel_of(text) is None


def test_no_two_channels_share_a_name():
    for channel in CHANNELS.values():
        for text in (channel.symbol, channel.name, *channel.aliases):
            assert channel_of(text) is channel
