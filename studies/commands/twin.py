"""The command `rodcone twin`: a camera measured from its frames, and the same frames simulated beside them."""

from importlib import metadata
from pathlib import Path

from rodcone.files import check_place, write_files
from sensor.cameras.frame_sets import open_set
from sensor.cameras.numbers import completed, preset_text
from sensor.presets import low_noise
from studies.commands.console import print_json, require_new, say
from studies.pages.twin_page import twin_page
from studies.twin.twin import twin_of


def twin(frames: Path, /, *, out: Path | None = None, seed: int = 0, json: bool = False) -> None:
    """Measure a camera from its frames, photograph the same lights with its preset, and set both side by side.

    Parameters
    ----------
    frames
        Set of flat and dark frames by light: a folder, a zip file, a descriptor of EMVA 1288 (.txt), or a list (.csv).
    out
        Preset of the camera to write (.toml), every number with its source; a page (.html) of the same name is written
        beside it.
    seed
        Seed of the simulated chip and of its frames.
    json
        Print one JSON object: each figure of camera and twin with the interval of their ratio.
    """
    page = None if out is None else out.with_suffix(".html")
    if out is not None and page is not None:
        require_new(out, ".toml")
        require_new(page, ".html")
        check_place(out)
    say("twin: measuring the frames, then simulating as many")
    with open_set(frames) as opened:
        found = twin_of(opened, frames.name, seed)
    if out is not None and page is not None:
        whole = completed(found.numbers, low_noise(), "low_noise")
        text = preset_text(f"A twin of the camera that took {frames.name}.", whole, None, "")
        write_files({out: text, page: twin_page(found, frames.name, metadata.version("rodcone"))})
    if json:
        print_json({"comparisons": [vars(one) | {"verdict": one.verdict} for one in found.comparisons]})
        return
    print("\n".join(one.verdict for one in found.comparisons))
    if out is not None:
        say(f"{out}: pitch_um and fill_factor, which frames don't tell, are low_noise's; put your camera's")
