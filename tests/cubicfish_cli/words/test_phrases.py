"""Photos and frames as sentences count them."""

from cubicfish.files import FrameName
from cubicfish_cli.words.phrases import counted


def test_frames_are_counted_by_film_and_photos_as_photos() -> None:
    frames = [f"{FrameName('garden', n)}.png" for n in range(3)]
    assert counted(["a.jpg", "b.jpg"]) == "2 photos"
    assert counted([]) == "0 photos"
    assert counted(frames) == "3 frames of garden"
    other = f"{FrameName('lab', 1.0)}.png"
    assert counted([other, *frames, "a.jpg"]) == "4 frames of lab, garden and 1 photo"
    many = [f"{FrameName(f'film{n}', 0.0)}.png" for n in range(4)]
    assert counted(many) == "4 frames of 4 films"
