"""Files appear whole or not at all, and a place that can't be written is named as it was asked for."""

import pytest
from refusal import refusal

from rodcone.files import check_place, inside, replacing


def test_all_files_take_their_names_at_the_end(tmp_path):
    first, second = tmp_path / "a.txt", tmp_path / "b.txt"
    first.write_text("old")
    with replacing(first, second) as (one, two):
        one.write_text("new")
        two.write_text("beside")
        assert first.read_text() == "old"
        assert not second.exists()
    assert [path.read_text() for path in (first, second)] == ["new", "beside"]
    assert sorted(tmp_path.iterdir()) == [first, second]


def test_a_failure_leaves_everything_as_it_was(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(UnicodeEncodeError), replacing(path) as (place,):
        place.write_text("half\n\ud800", "utf-8")
    with pytest.raises(FileNotFoundError), replacing(path, tmp_path / "b.txt") as (_, second):
        second.write_text("the first was never written")
    assert [(found, found.read_text()) for found in tmp_path.iterdir()] == [(path, "old")]


def test_a_missing_folder_is_told_by_the_file_s_own_name(tmp_path):
    path = tmp_path / "absent" / "a.txt"
    with pytest.raises(FileNotFoundError) as error, replacing(path):
        pass
    assert error.value.filename == str(path)


def test_a_place_is_checked_by_making_its_folder_and_leaves_no_file(tmp_path):
    path = tmp_path / "new" / "deep" / "a.txt"
    check_place(path)
    assert list(path.parent.iterdir()) == []


def test_a_name_that_leads_out_of_its_folder_is_refused_and_one_below_it_is_a_place_in_it(tmp_path):
    folder = tmp_path / "pictures"
    (folder / "sub").mkdir(parents=True)
    (folder / "link").symlink_to(tmp_path)
    for name in ("../a.png", "/a.png", "sub/../../a.png", "link/a.png", "", "a\0b"):
        refusal(inside, folder, name, match="does not lie in")
    for name in ("a.png", "sub/a.png", "sub/../a.png", "..a.png"):
        assert inside(folder, name) == folder / name
