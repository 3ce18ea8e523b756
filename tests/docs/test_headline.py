"""The headline: photographs by hash out of packages, rules without a choice, leads and both of their intervals."""

import io
import tarfile
import tomllib
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from zipfile import ZipFile

import drawn_scenes
import headline
import numpy as np
import photograph_spectra
import pytest
import white_pixel
from headline import (
    BAYER,
    CHART,
    FIGURES,
    LEVELS,
    PAGE,
    PAIRS,
    RGBW,
    Lead,
    all_leads,
    cameras_of,
    csv_rows,
    leads,
    mean_delta_e,
    page_table,
    quoted,
    split,
    write_study,
)
from headline_photographs import SIDE, Photograph, listed, read_crops
from page_parts import RESULTS
from PIL import Image
from refusal import refusal

from rodcone.colour_spaces import decode_srgb
from studies.training import pictures

PIXELS = np.random.default_rng(3).integers(0, 256, (3 * SIDE + 5, 4 * SIDE, 3), np.uint8)
BEST = "bayer_net"


def png() -> bytes:
    file = io.BytesIO()
    Image.fromarray(PIXELS).save(file, "PNG")
    return file.getvalue()


def photograph(name: str, package: str, content: bytes) -> Photograph:
    file = "usr/share/backgrounds/a b.png"
    return Photograph(name, package, "1.0-1", file, sha256(content).hexdigest(), "CC0-1.0", "A", 7, 2, 3 * SIDE)


def deb(path: Path, file: str, content: bytes) -> None:
    """Write a Debian package by hand: members of odd and even length behind headers of 60 bytes."""
    data = io.BytesIO()
    with tarfile.open(fileobj=data, mode="w:xz") as files:
        member = tarfile.TarInfo(f"./{file}")
        member.size = len(content)
        files.addfile(member, io.BytesIO(content))
    members = (("debian-binary", b"2.0\n"), ("control.tar.xz", b"odd"), ("data.tar.xz", data.getvalue()))
    text = b"!<arch>\n"
    for name, value in members:
        text += (
            f"{name:<16}{0:<12}{0:<6}{0:<6}{100644:<8}{len(value):<10}`\n".encode() + value + b"\n" * (len(value) % 2)
        )
    path.write_bytes(text)


def test_the_list_is_whole_and_none_of_it_is_used_elsewhere() -> None:
    photographs = listed()
    assert len({one.name for one in photographs}) == len({one.sha256 for one in photographs}) == len(photographs) >= 28
    assert len({one.package for one in photographs}) >= 3
    assert all(one.licence and one.author and len(one.sha256) == 64 for one in photographs)
    assert all(one.side % SIDE == 0 and one.side >= 3 * SIDE for one in photographs)
    groups = (*drawn_scenes.PHOTOGRAPHS.values(), *photograph_spectra.PHOTOGRAPHS.values(), white_pixel.PHOTOGRAPHS)
    used = {Path(name).stem.lower() for group in (*groups, pictures.PHOTOGRAPHS) for name in group}
    assert used.isdisjoint({Path(one.file).stem.lower() for one in photographs})


def test_crops_come_out_of_packages_by_hash_and_average_light(tmp_path: Path) -> None:
    content = png()
    wanted = [photograph("from_deb", "pictures", content), photograph("from_wheel", "some-pictures", content)]
    deb(tmp_path / "pictures_1.0-1_all.deb", wanted[0].file, content)
    with ZipFile(tmp_path / "Some_Pictures-1.0-py3-none-any.whl", "w") as wheel:
        wheel.writestr(wanted[1].file, content)
    crops = read_crops(tmp_path, wanted)
    light = decode_srgb(PIXELS / 255.0)[2 : 2 + 3 * SIDE, 7 : 7 + 3 * SIDE]
    for crop in crops.values():
        assert crop.shape == (SIDE, SIDE, 3)
        assert decode_srgb(crop[4, 9] / 255.0) == pytest.approx(light[12:15, 27:30].mean(axis=(0, 1)), abs=4e-3)
    other = replace(wanted[0], sha256="0" * 64)
    refusal(
        read_crops, tmp_path, [other], match=r"lacks pictures 1\.0-1 \(1 pictures\).*apt-get download pictures=1\.0-1"
    )
    absent = replace(wanted[0], package="others")
    refusal(read_crops, tmp_path, [*wanted, absent], match=r"lacks others 1\.0-1 \(1 pictures\); download them there")
    (tmp_path / "pictures_1.0-1_all.deb").write_bytes(b"!<arch>\n")
    refusal(read_crops, tmp_path, wanted, match="it is no Debian package; download it again")


def test_a_picture_of_one_deep_red_is_out_and_the_least_hashes_are_held() -> None:
    blue = np.full((SIDE, SIDE, 3), (150, 140, 120), np.uint8)
    assert headline.ceiling_db(blue) > headline.CEILING_DB
    assert headline.ceiling_db(np.full((SIDE, SIDE, 3), (200, 30, 20), np.uint8)) < headline.CEILING_DB
    photographs = [replace(photograph(f"{n}", "p", b""), sha256=f"{(7 * n) % 12:064x}") for n in range(12)]
    parts = split({one: 34.9 if one.name in "03" else 35.0 for one in photographs})
    assert [one.name for one in parts.out] == ["0", "3"]
    # of the hashes 1 to 11, but 9 of picture 3, the eight least
    assert [int(one.sha256, 16) for one in parts.held] == [1, 2, 3, 4, 5, 6, 7, 8]
    assert [int(one.sha256, 16) for one in parts.sample] == [11, 10]
    assert {*parts.sample}.isdisjoint(parts.held)


def cells(lead: float) -> dict[tuple[str, str, str], dict[str, float]]:
    """Three photographs, one held out, one drawn scene and the chart; RGBW is ahead by `lead` times 1, 2, 3 and 9."""
    found = {}
    for number, scene in enumerate(("a", "b", "c", "h", "generated-1", CHART)):
        for level in LEVELS:
            ahead = {"a": 1.0, "b": 2.0, "c": 3.0, "h": 9.0}.get(scene, 5.0) * lead
            learned = dict(zip(PAIRS["learned"], (2.0 * ahead, -3.0), strict=True))
            paper = dict(zip(PAIRS["paper"], (3.0 * ahead, -4.0), strict=True))
            for camera, more in {RGBW: ahead, BAYER: 0.0, BEST: -1.0, **learned, **paper}.items():
                better = dict.fromkeys(FIGURES, 10.0 + number - more) | {"psnr_db": 20.0 + number + more}
                found[scene, level, camera] = better
    return found


def test_leads_are_positive_where_the_first_is_better_and_both_is_of_the_best() -> None:
    of = cells(0.5)
    for figure in FIGURES:
        assert leads(of, ["a", "c"], "100cd/m2", "mosaic", figure) == pytest.approx([0.5, 1.5])
        assert leads(of, ["a", "c"], "100cd/m2", "processing", figure) == pytest.approx([-1.0, -1.0])
        assert leads(of, ["a", "c"], "100cd/m2", "both", figure) == pytest.approx([2.0, 4.0])
        assert leads(of, ["a", "c"], "5cd/m2", "learned", figure) == pytest.approx([4.0, 6.0])
        assert leads(of, ["a", "c"], "5cd/m2", "paper", figure) == pytest.approx([5.5, 8.5])
    assert cameras_of("both", "0.05cd/m2") == PAIRS["learned"]


def test_both_intervals_by_hand() -> None:
    lead = Lead(np.array([1.0, 2.0, 3.0]), np.array([6.9, 7.0]))
    assert lead.mean == 2.0
    # Student's t of 2 degrees at 97.5 % is 4.3027, the deviation 1
    assert lead.mean_within == pytest.approx(4.3027 / np.sqrt(3), rel=1e-4)
    assert lead.within(1) == pytest.approx(4.3027 * np.sqrt(1 + 1 / 3), rel=1e-4)  # 4.968
    assert lead.within(2) == pytest.approx(4.3027 * np.sqrt(1 / 2 + 1 / 3), rel=1e-4)
    assert lead.held_inside == 1


def test_nineteen_of_twenty_further_pictures_fall_inside() -> None:
    """Of 4000 draws of 20 and 8; shares within 4.5 standard errors, which chance breaks once in 70 000."""
    rng = np.random.default_rng(17)
    found = [Lead(rng.normal(1, 2, 20), rng.normal(1, 2, 8)) for _ in range(4000)]
    single = np.array([lead.held_inside / 8 for lead in found])
    mean = np.array([abs(lead.mean - 1) <= lead.mean_within for lead in found])
    eight = np.array([abs(lead.held.mean() - lead.mean) <= lead.within(8) for lead in found])
    for share in (single, mean, eight):
        assert abs(share.mean() - 0.95) < 4.5 * share.std() / np.sqrt(4000)


def test_tables_and_page_say_what_was_measured() -> None:
    found = all_leads(cells(0.5), {"photographs": ["a", "b", "c"], "drawn": ["generated-1"], CHART: [CHART]}, ["h"])
    rows = list(csv_rows(found))
    assert {len(row) for row in rows} == {len(headline.HEAD) + len(headline.HEAD_HELD)}
    (row,) = (row for row in rows if row[:6] == ["photographs", "mosaic", RGBW, BAYER, "psnr_db", "5cd/m2"])
    # mean 1, deviation 0.5: half the intervals are 1.242 and 2.484; the one held out is at 4.5
    assert row[6:] == ["3", "+1.0000", "1.2421", "2.4841", "1", "0", "+4.5000", "no"]
    assert "| 3 photographs | mosaic | PSNR [dB] | +1.0 ± 1.2 (± 2.5; 0 of 1) |" in (text := page_table(found, 4))
    assert "3 photographs, 1 more held out, 4 out by the rule" in text
    assert f"| `{CHART}` | mosaic | ΔE2000 of the chart's patches | +2.5 |" in text
    assert text.count("ΔE2000 of the chart's patches") == 5
    assert quoted(found)["mosaic.psnr.5"] == "+1.0 ± 1.2"
    assert quoted(all_leads(cells(-0.5), {"photographs": ["a", "b", "c"]}, ["h"]))["mosaic.flip.100"].startswith(
        "\u22121"
    )
    assert PAGE.read_text("utf-8").count("<!-- headline -->") == 1


def test_mean_delta_e_is_that_of_the_pixels() -> None:
    """Between greys CIEDE2000 is the difference of lightness over S_L, by hand for L* of 50 and 60."""
    grey = [np.full((2, 2, 3), ((lightness + 16) / 116) ** 3) for lightness in (50.0, 60.0)]
    s_l = 1 + 0.015 * 25 / np.sqrt(20 + 25)
    assert mean_delta_e(*grey) == pytest.approx(10 / s_l, rel=2e-3)


def test_the_study_holds_sample_held_out_drawn_and_chart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pale = np.full((SIDE, SIDE, 3), (150, 140, 120), np.uint8)
    crops = {replace(photograph(f"p{n}", "p", b""), sha256=f"{n:064x}"): pale for n in range(10)}
    monkeypatch.setattr(headline, "read_crops", lambda *_: crops)
    refusal(write_study, str(tmp_path), str(tmp_path / "study"), match="pip download --no-deps .* demosaicnet")
    (tmp_path / "demosaicnet-0.0.14-py3-none-any.whl").write_bytes(b"")
    write_study(str(tmp_path), str(tmp_path / "study"))
    study = tomllib.loads((tmp_path / "study" / "study.toml").read_text("utf-8"))
    assert study["scenes"][:10] == ["p8.png", "p9.png", *(f"p{n}.png" for n in range(8))]
    assert sum(name.startswith("generated-a10b90d1") for name in study["scenes"]) == headline.DRAWN
    assert study["scenes"][-1] == CHART
    assert study["levels"] == list(LEVELS)
    assert study["seeds"] == [0, 1]
    with Image.open(tmp_path / "study" / "p3.png") as kept:
        assert np.array_equal(np.asarray(kept), pale)


def test_the_shipped_tables_are_those_of_the_list() -> None:
    text = (RESULTS / "headline_pictures.csv").read_text("utf-8")
    assert all(f"\n{one.name}," in text for one in listed())
