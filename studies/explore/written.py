"""The Python that makes a shot again to the bit."""

from studies.explore.controls import Controls, Lamp, to_json
from studies.explore.views import VIEWS

GIVEN = "transport = ...  # the one that was given to rodcone.explore\n"


def python_of(render: str, controls: Controls, view: str = "picture") -> str:
    """Python that makes a picture of the page again, to the bit.

    Parameters
    ----------
    render : str
        Lines that make `transport` (`studies.explore.source.Rendered`), or `GIVEN`.
    controls : Controls
    view : str
        Of `studies.explore.views.VIEWS`, ``histogram``, or ``pixel ROW COLUMN``.
    """
    settings, defaults, default_lamp = to_json(controls), to_json(Controls()), vars(Lamp())
    settings["lamps"] = {
        group: {name: value for name, value in lamp.items() if value != default_lamp[name] and value != []}
        for group, lamp in settings["lamps"].items()
    }
    changed = {name: value for name, value in settings.items() if value != defaults[name]}
    given = "".join(f"    {name}={value!r},\n" for name, value in changed.items())
    made, comment = ("picture", "  # (h, w, 3) uint8") if view in VIEWS else ("figure", "")
    arguments = f"\n    transport,\n    {view!r},\n{given}" if given else f"transport, {view!r}"
    lines = f"{render}{made} = rodcone.explorer_view({arguments}){comment}".splitlines()
    imports = [line for line in lines if line.startswith(("from ", "import "))]
    code = [line for line in lines if line and line not in imports]
    return "\n".join([*imports, "import rodcone", "", *code, ""])
