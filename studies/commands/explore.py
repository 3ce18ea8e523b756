"""The command `rodcone explore`."""

import webbrowser
from dataclasses import replace
from functools import partial
from typing import Annotated

from cyclopts import Parameter

from scenes.catalogue import scene_names
from studies.commands.console import say
from studies.explore.server import listen, make_server, require_server
from studies.explore.session import Session
from studies.explore.source import RenderOptions, open_source

DEFAULT = RenderOptions()


def explore(
    source: str = "still_life",
    /,
    options: Annotated[RenderOptions, Parameter(name="*")] = DEFAULT,
    *,
    port: int = 0,
    no_browser: bool = False,
) -> None:
    """Play with a camera on a page of this machine: every control answers with the picture it makes.

    Prints the page's address, opens it in the browser and runs until Ctrl-C. The page is served to this machine alone.

    Parameters
    ----------
    source
        Scene by name such as still_life, a Mitsuba scene (.xml), a file of spectral radiance (.exr, .mat), a cube
        described by a .toml beside it (.npy, ENVI's .hdr, .mat), a photograph (.jpg, .png), or
        reference light (.npz of rodcone reference).
    port
        Port of the page's address; a free one by default.
    no_browser
        Print the address, and open no browser.
    """
    require_server()
    opened = open_source(source, options)
    by_name = replace(options, trust_scene=False, define=())  # a scene of the catalogue has neither option
    scenes = {name: partial(open_source, name, by_name) for name in scene_names()} | {opened.title: lambda: opened}
    with listen(port) as listener:
        say(*opened.notes)
        session = Session(opened, scenes)
        server, address = make_server(session, listener)
        print(address, flush=True)
        if not no_browser:
            webbrowser.open(address)
        try:
            server.run(sockets=[listener])
        finally:
            session.close()
