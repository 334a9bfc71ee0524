"""Photos and frames as sentences count them."""

import subprocess
from pathlib import Path

from cubicfish.files import FrameName
from cubicfish_cli.words import phrases
from cubicfish_cli.words.phrases import counted, shell_line


def test_frames_are_counted_by_film_and_photos_as_photos() -> None:
    frames = [f"{FrameName('garden', n)}.png" for n in range(3)]
    assert counted(["a.jpg", "b.jpg"]) == "2 photos"
    assert counted([]) == "0 photos"
    assert counted(frames) == "3 frames of garden"
    other = f"{FrameName('lab', 1.0)}.png"
    assert counted([other, *frames, "a.jpg"]) == "4 frames of lab, garden and 1 photo"
    many = [f"{FrameName(f'film{n}', 0.0)}.png" for n in range(4)]
    assert counted(many) == "4 frames of 4 films"


def test_a_command_can_be_pasted_whatever_its_names_are() -> None:
    names = [Path("a b;$(id)"), Path("-rf"), "it's", Path("plain.png")]
    line = shell_line("printf", "%s\\n", *names)
    said = subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=True).stdout
    assert said.splitlines() == ["a b;$(id)", "./-rf", "it's", "plain.png"]


def test_only_one_function_quotes_for_a_shell() -> None:
    package = Path(phrases.__file__).parents[1]
    using = [path for path in package.rglob("*.py") if "import shlex" in path.read_text()]
    assert using == [Path(phrases.__file__)]
