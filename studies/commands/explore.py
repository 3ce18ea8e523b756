"""The command `rodcone explore`."""

import webbrowser
from functools import partial

from scenes.catalog import names
from studies.commands.console import say
from studies.explore.server import listen, make_server
from studies.explore.session import Session
from studies.explore.source import RenderOptions, open_source


def explore(
    source: str = "still_life",
    /,
    *,
    size: int | None = None,
    spp: int = 64,
    band_nm: float = 20.0,
    seed: int = 0,
    port: int = 0,
    no_browser: bool = False,
    trust_scene: bool = False,
    force: bool = False,
) -> None:
    """Play with a camera on a page of this machine: every control answers with the picture it makes.

    Prints the page's address, opens it in the browser and runs until Ctrl-C. The page is served to this machine alone.

    Parameters
    ----------
    source
        Scene by name such as still_life, a Mitsuba scene (.xml), a file of spectral radiance (.exr, .mat), a cube
        described by a .toml beside it (.npy, ENVI's .hdr, .mat), a photograph (.jpg, .png), or a study (.toml), whose
        first scene and camera the page begins with.
    size
        Longer side of the rendered picture in pixels; 256 by default, a .xml scene's film has its own.
    spp
        Samples a pixel of the render.
    band_nm
        Width of the wavelength bands; 20 nm do for smooth spectra.
    seed
        Seed of the render.
    port
        Port of the page's address; a free one by default.
    no_browser
        Print the address, and open no browser.
    trust_scene
        Let a .xml scene load plug-ins of its own, which are native code, and files from anywhere.
    force
        Run even where more memory is needed than is free.
    """
    options = RenderOptions(size=size, spp=spp, band_nm=band_nm, seed=seed, trust=trust_scene, force=force)
    opened = open_source(source, options)
    scenes = {name: partial(open_source, name, options) for name in names()} | {opened.title: lambda: opened}
    say(*opened.notes)
    with listen(port) as listener:
        session = Session(opened, scenes)
        server, address = make_server(session, listener)
        print(address, flush=True)
        if not no_browser:
            webbrowser.open(address)
        try:
            server.run(sockets=[listener])
        finally:
            session.close()
