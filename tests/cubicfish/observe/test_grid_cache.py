"""Photos that did not change are not searched again; whatever changed is."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from cubicfish.find.detection.grids import FoundGrids, Grid
from cubicfish.observe import photo_detection
from cubicfish.observe.detection import first_pass
from cubicfish.observe.photo_detection import GridCache, detect_in_photo
from cubicfish.photos.photos import Photo, PictureFile, find_photos
from cubicfish.target.target import Target
from cubicfish.workers.pool import Work

SAMPLE = Path(__file__).parents[3] / "sample_data"
TARGET = Target.load(SAMPLE / "target.yaml")


@pytest.fixture
def cache(tmp_path):
    return GridCache(folder=tmp_path / "cache")


def found(count=2):
    rng = np.random.default_rng(count)
    return FoundGrids(
        grids=tuple(
            Grid(
                cells=rng.integers(0, 9, (5 + n, 2)),
                pixel=rng.uniform(0, 900, (5 + n, 2)),
                parity=(-1) ** n,
                step=17.5 + n,
                contrast=rng.uniform(0, 99, 5 + n),
            )
            for n in range(count)
        ),
        refused=rng.uniform(0, 900, (3, 2)),
        image_size=(960, 720),
    )


@pytest.mark.parametrize("count", [0, 1, 3])
def test_round_trip_is_exact(cache, count):
    saved = found(count)
    cache.save("k", saved)
    loaded = cache.load("k")
    assert loaded is not None
    assert loaded.image_size == saved.image_size
    np.testing.assert_array_equal(loaded.refused, saved.refused)
    assert len(loaded.grids) == count
    for one, other in zip(loaded.grids, saved.grids, strict=True):
        np.testing.assert_array_equal(one.cells, other.cells)
        np.testing.assert_array_equal(one.pixel, other.pixel)
        np.testing.assert_array_equal(one.contrast, other.contrast)
        assert (one.parity, one.step) == (other.parity, other.step)


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04", b"not a zip", None])
def test_a_damaged_entry_is_no_entry(cache, damage):
    cache.save("k", found())
    entry = cache.folder / "k.npz"
    entry.write_bytes(entry.read_bytes()[:-50] if damage is None else damage)
    assert cache.load("k") is None
    assert cache.load("none") is None


def test_key_follows_the_bytes_and_the_finder(cache, monkeypatch):
    key = cache.key(b"photo", [(9, 6), (5, 4)])
    assert cache.key(b"photo", [(4, 5), (6, 9)]) == key
    assert cache.key(b"photO", [(9, 6), (5, 4)]) != key
    assert cache.key(b"photo", [(9, 6)]) != key
    monkeypatch.setattr(photo_detection, "_hash_sources", lambda: "another")
    assert cache.key(b"photo", [(9, 6), (5, 4)]) != key


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path):
    (tmp_path / "file").write_text("")
    cache = GridCache(folder=tmp_path / "file" / "cache")
    cache.save("k", found())
    assert cache.load("k") is None


@pytest.mark.slow
def test_unchanged_photos_are_not_searched_again(cache, tmp_path, monkeypatch):
    folder = tmp_path / "photos"
    folder.mkdir()
    for name in ("corner_01.jpg", "corner_03.jpg"):
        shutil.copy(SAMPLE / "photos" / name, folder / name)
    searched = []
    search = photo_detection.find_grids
    monkeypatch.setattr(photo_detection, "find_grids", lambda *p: searched.append(1) or search(*p))
    first = first_pass(find_photos([folder]), [TARGET], Work(jobs=1), cache.folder)
    assert len(searched) == 2
    (folder / "corner_03.jpg").rename(folder / "renamed.jpg")
    again = first_pass(find_photos([folder]), [TARGET], Work(jobs=1), cache.folder)
    assert len(searched) == 2
    np.testing.assert_array_equal(again.corners.pixel, first.corners.pixel)
    shutil.copy(SAMPLE / "photos" / "corner_02.jpg", folder / "corner_01.jpg")
    first_pass(find_photos([folder]), [TARGET], Work(jobs=1), cache.folder)
    assert len(searched) == 3


def test_a_picture_at_hand_is_not_decoded_and_known_by_its_file(cache, tmp_path, monkeypatch):
    picture, searched, decoded = np.zeros((40, 50), np.uint8), [], []
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), picture)
    monkeypatch.setattr(photo_detection, "find_grids", lambda *given: searched.append(1) or found())
    decode = PictureFile.picture
    monkeypatch.setattr(PictureFile, "picture", lambda own: decoded.append(1) or decode(own))
    photo = Photo(name="a.png", path=path, picture=picture)
    detect_in_photo(photo, target=None, cache=cache)
    assert len(searched) == 1
    detect_in_photo(photo, target=None, cache=cache)
    assert len(searched) == 1
    assert not decoded
    detect_in_photo(Photo(name="a.png", path=path), target=None, cache=cache)
    assert len(searched) == 1
    # An array may have the name of a file that shows something else.
    other = Photo(name="a.png", path=path, picture=picture, has_file=False)
    detect_in_photo(other, target=None, cache=cache)
    assert len(searched) == 2
