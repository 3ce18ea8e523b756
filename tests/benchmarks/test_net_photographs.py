"""Photographs to train a network on: their list, their folder out of clones, and which are left out to validate on."""

import io
import subprocess
from hashlib import sha256

import net_photographs
import numpy as np
from headline_photographs import listed as judging
from net_frames import photographs_of
from net_photographs import NetPhotograph, is_held, listed, read_linear, write_folder
from PIL import Image

from rodcone.colour_spaces import decode_srgb

FREE = {"CC0-1.0", "public domain", "CC-BY-2.0", "CC-BY-3.0", "CC-BY-4.0", "CC-BY-SA-3.0", "CC-BY-SA-4.0"}


def test_the_list_has_free_photographs_and_none_that_judges():
    photographs = listed()
    assert {photograph.licence for photograph in photographs} <= FREE
    assert len({photograph.name for photograph in photographs}) == len(photographs)
    assert not {photograph.sha256 for photograph in photographs} & {photograph.sha256 for photograph in judging()}
    assert not {photograph.author for photograph in photographs} & {photograph.author for photograph in judging()}


def test_a_folder_is_made_upright_and_reduced_and_what_is_absent_is_named(tmp_path, monkeypatch, capsys):
    clone = tmp_path / "clones" / "someone" / "pictures"
    clone.mkdir(parents=True)
    pixels = np.repeat(np.repeat(np.array([[[200, 40, 30], [30, 60, 180]]], np.uint8), 64, 0), 64, 1)  # red beside blue
    exif = Image.Exif()
    exif[274] = 6  # shown turned clockwise
    content = io.BytesIO()
    Image.fromarray(pixels).save(content, "PNG", exif=exif)
    (clone / "two colours.png").write_bytes(content.getvalue())
    git = ["git", "-C", clone, "-c", "user.name=x", "-c", "user.email=x"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "x"]):
        subprocess.run([*git, *words], check=True)
    commit = subprocess.run([*git, "rev-parse", "HEAD"], check=True, capture_output=True, text=True).stdout.strip()
    known = NetPhotograph(
        "known", "someone/pictures", commit, "two colours.png", "", "", sha256(content.getvalue()).hexdigest()
    )
    other = NetPhotograph("other", "someone/else", commit, "two colours.png", "", "", known.sha256)
    changed = NetPhotograph("changed", known.repository, commit, known.path, "", "", 64 * "0")
    monkeypatch.setattr(net_photographs, "listed", lambda: [known, other, changed])
    write_folder(tmp_path / "clones", tmp_path / "made", 100)
    ((name, linear),) = read_linear(tmp_path / "made")
    assert name == "known"
    assert linear.shape == (64, 32, 3)
    np.testing.assert_allclose(linear[[10, 50], 16], decode_srgb(pixels[0, [0, -1]] / 255.0))
    told = capsys.readouterr().out
    assert "someone/else: 1 photographs are left out" in told
    assert "someone/pictures: 1 photographs are left out" in told


def test_one_photograph_in_ten_validates_and_none_does_both(tmp_path):
    for photograph in listed():
        (tmp_path / f"{photograph.name}.png").touch()
    trained, held = (photographs_of(tmp_path, part) for part in (False, True))
    of_scikit_image = sum(len(photographs_of(None, part)) for part in (False, True))
    assert len(trained) + len(held) == len(listed()) + of_scikit_image
    assert not {*trained} & {*held}
    assert 0.05 < sum(is_held(photograph.name) for photograph in listed()) / len(listed()) < 0.15
