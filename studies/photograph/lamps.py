"""Lamps that flicker: read from texts which lamps of a scene do, and separate the light that they give."""

from collections.abc import Collection, Mapping, Sequence

from render.radiance import SpectralRadiance
from render.spectrum import Spectrum
from render.transport import Transport
from rodcone.errors import InputError, require_name
from sensor.flicker.waveform import Waveform, waveform

ALL = ""  # key for all lamps together, in place of a light group's name


def flicker_of(texts: Sequence[str], groups: Collection[str]) -> dict[str, Waveform]:
    """Return the waveforms of flickering lamps by light group, or by `ALL` where groups aren't known.

    Parameters
    ----------
    texts : sequence of str
        ``GROUP=WAVEFORM``, or ``WAVEFORM`` alone for every lamp; a later text replaces an earlier one.
    groups : collection of str
        Light groups of the scene; empty for a picture, whose lamps aren't known apart.

    Raises
    ------
    InputError
        For an unknown group or waveform.
    """
    found: dict[str, Waveform] = {}
    for text in texts:
        group, equals, name = text.rpartition("=")
        if equals and not groups:
            raise InputError(
                f"flicker: {text!r} for a picture, whose lamps aren't known apart; allowed: a waveform of all its "
                f"light; write {name}"
            )
        if equals:
            require_name("flicker: light group", group, groups)
        found |= dict.fromkeys([group] if equals else (groups or [ALL]), waveform(name))
    return found


def lamp_parts(
    transport: Transport, spectra: Mapping[str, Spectrum], level: Mapping[str, float], flicker: Mapping[str, Waveform]
) -> list[tuple[Waveform, SpectralRadiance | None]]:
    """Return each waveform with the light of its lamps alone, as bright as among all lamps; nothing is rendered.

    If all lamps have one waveform, None takes the place of the light, which is then the whole.

    Parameters
    ----------
    transport : Transport
    spectra, level : mapping
        As in `Transport.relight`.
    flicker : mapping of str to Waveform
        As from `flicker_of`.
    """
    apart = list(dict.fromkeys(flicker.values()))
    if len(apart) == 1 and (ALL in flicker or set(flicker) == set(transport.groups)):
        return [(apart[0], None)]
    groups = {lamp: [name for name, its in flicker.items() if its == lamp] for lamp in apart}
    return [(lamp, transport.relight_part(names, spectra, **level)) for lamp, names in groups.items()]
