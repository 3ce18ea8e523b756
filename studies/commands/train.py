"""The command `rodcone train`."""

import json as notation
from pathlib import Path

from isp.ple.prior import save_prior
from rodcone.errors import InputError, require_name
from rodcone.files import check_place, require_ending
from sensor.presets import preset
from studies.commands.console import print_result
from studies.training.spectral import KINDS_OF, train_spectral_prior
from studies.training.train import train_prior


def train(
    *, sensor: str | None = None, spectral: str | None = None, out: Path, seed: int = 1, json: bool = False
) -> None:
    """Train a prior over patches: of a sensor's curves, for ple, or of reflectances, for expect, and print its path.

    Takes some three minutes on two cores and 1.5 GB. The prior serves every noise, well, exposure and mosaic of
    these curves: isp.processors.catalogue.PROCESSORS["ple"].develop(..., prior=load_prior(path)).

    Parameters
    ----------
    sensor
        Sensor preset by name, or a .toml file (see `rodcone new preset`), with responses of R, G, B and W.
    spectral
        In place of a sensor: a prior over reflectances, from drawn pictures and photographs ("drawn") or from
        photographs alone ("photographs").
    out
        File to write, ending in .npz.
    seed
        Seed of the training pictures and of the fit.
    json
        Print one JSON object with the path and the prior's provenance instead of the path.
    """
    require_ending(out, ".npz")
    if (sensor is None) == (spectral is None):
        raise InputError("sensor: allowed: either --sensor or --spectral; give one")
    if spectral is not None:
        require_name("spectral", spectral, KINDS_OF)
        check_place(out)
        source = train_spectral_prior(spectral, seed, out)
        print_result(out, {"path": str(out), **notation.loads(source)}, json=json)
        return
    assert sensor is not None
    camera = preset(sensor)
    missing = [channel for channel in "RGBW" if channel not in camera.responses.curves]
    if missing:
        raise InputError(f"sensor: {sensor!r} has no curve of {', '.join(missing)}; allowed: R, G, B and W; add it")
    check_place(out)
    prior = train_prior(camera, Path(sensor).stem, seed)
    save_prior(prior, out)
    print_result(out, {"path": str(out), **notation.loads(prior.source)}, json=json)
