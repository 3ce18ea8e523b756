"""The card of a set: what is in it, how bright and how noisy, who may use it, and how it was made."""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from studies.dataset.sample import PLANES
from studies.dataset.shards import MANIFEST
from studies.pages.report_text import table
from studies.study.render_noise import noise_note

CARD = "README.md"
_SNR_DB = (0.0, 10.0, 20.0, 30.0)
_NOISE = (0.01, 0.03, 0.1, 0.3, 1.0)
_BAR = 30  # characters of the longest


def card(lines: Sequence[dict[str, Any]]) -> str:
    """Card as Markdown, of a manifest's lines."""
    kinds = ("set", "scene", "shard", "sample")
    (head,), scenes, shards, samples = ([line for line in lines if line["kind"] == kind] for kind in kinds)
    size = sum(line["bytes"] for line in shards) / 1e9
    licences = Counter(line["licence"] for line in scenes)
    splits = [
        (split, sum(x["samples"] for x in shards if x["split"] == split), sum(x["split"] == split for x in scenes))
        for split in dict.fromkeys(line["split"] for line in shards)
    ]
    noise = {name: [line["render_noise"][name] for line in samples] for name in ("mean", "of_95_percent")}
    parts = [
        f"# {head['name']}",
        f"{len(samples)} raw frames of simulated cameras with the truth behind them, {size:.3g} GB in "
        f"{len(shards)} shards. Made by rodcone {head['rodcone']}:",
        f"    {head['command']}",
        table(("split", "samples", "scenes"), splits),
        "A scene is in one split alone, chosen by its hash. Shards are tar files in WebDataset's layout: "
        "`KEY.raw.npy` (DN), `KEY.json` (facts: mosaic, black and white level, gain, noise, exposure, light) and",
        table(("file", "what it holds"), [(f"`KEY.{name}.npy`", PLANES[name]) for name in head["planes"]]),
        f"Facts of noise: the variance of a pixel is a x + b + c x² [DN²], x its mean above black. `{MANIFEST}` lists "
        "scenes, shards with their digests, and samples.",
        "## Light, noise and the render's own noise",
        _counts("level", Counter(x["level"] for x in sorted(samples, key=lambda x: x["luminance_cd_m2"]))),
        _histogram("SNR, dB", [line["snr_db"] for line in samples], _SNR_DB),
        _histogram("render's variance over the sensor's, in 95 % of the pixels", noise["of_95_percent"], _NOISE),
        *filter(None, [noise_note(max(noise["mean"], default=0.0), 0)]),
        "## Licences",
        table(("scenes", "licence"), [(count, text) for text, count in licences.items()]),
    ]
    return "\n\n".join(parts) + "\n"


def _histogram(what: str, values: Sequence[float], edges: Sequence[float]) -> str:
    between = (f"{low:g} to {high:g}" for low, high in pairwise(edges))
    names = (f"under {edges[0]:g}", *between, f"{edges[-1]:g} and more")
    counts = np.bincount(np.searchsorted(edges, values, side="right"), minlength=len(names))
    return _counts(what, dict(zip(names, counts.tolist(), strict=True)))


def _counts(what: str, counts: Mapping[str, int]) -> str:
    most = max(counts.values(), default=1) or 1
    return table((what, "samples", ""), [(name, n, "█" * round(_BAR * n / most)) for name, n in counts.items()])
