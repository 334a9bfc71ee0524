"""Extensions that fail: each is named once, and everything else goes on as if it were not there."""

import os
import re
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from running import Run, invoke_cli
from samples import ROOT, SAMPLE

from cubicfish import CubicfishError, Finding
from cubicfish_cli import extension_guard
from cubicfish_cli.extension_guard import ExtensionWarning, extensions, read_formats
from cubicfish_cli.extension_table import GROUP
from cubicfish_cli.foreign.foreign_files import read_foreign
from cubicfish_cli.terminal import start
from cubicfish_cli.words.sentences import all_words, record_of, render

SHARED = ROOT.parent / "shared" / "data" / "faults" / "extensions"
IMPORTED = "from cubicfish_cli.extension_table import Extension, Input, Output\n"
FORMAT = """
[{name}]
write = "os:getcwd"
file_name = "a"
[{name}.written.{name}]
what = "a"
lens = "a:b"
"""
READ = """
[bar]
read = "a:b"
write = "a:b"
file_name = "a"
written = {}
"""

RECORDS = {
    "no_commands": "commands=None",
    "a_list_of_commands": "commands=['mine']",
    "a_number_as_place": "commands={'mine': 3}",
    "no_place": "commands={'mine': 'evilext'}",
    "three_words": "commands={'rig map fast': 'a:b'}",
    "the_cores_command": "commands={'calibrate': 'a:b'}",
    "the_cores_subcommand": "commands={'target check': 'a:b'}",
    "anothers_command": "commands={'simulate': 'a:b'}",
    "a_group_that_it_does_not_need": "commands={'rig zip': 'a:b'}",
    "no_inputs": "inputs=None",
    "no_input": "inputs=['os:getcwd']",
    "no_outputs": "outputs=[Output(file='a.txt', content='a:b')]",
    "the_cores_kind": "outputs={'camera': Output(file='mine.txt', content='a:b')}",
    "the_cores_file": "outputs={'mine': Output(file='Camera.yaml', content='a:b')}",
    "anothers_file": "outputs={'mine': Output(file='report.html', content='a:b')}",
    "a_folder_of_films": "outputs={'mine': Output(file='frames', content='a:b')}",
    "outside": "outputs={'mine': Output(file='../mine.txt', content='a:b')}",
    "in_a_folder": r"outputs={'mine': Output(file='a\\b.txt', content='a:b')}",
    "anywhere": "outputs={'mine': Output(file='/tmp/mine.txt', content='a:b')}",
    "no_file_name": "outputs={'mine': Output(file='', content='a:b')}",
    "no_words": "words='words.toml'",
    "words_that_are_not_there": "words=HERE / 'words.toml'",
    "words_that_are_none": "words=HERE / 'evilext.py'",
    "formats_that_are_not_there": "formats=HERE / 'formats.toml'",
    "a_format_without_all_its_keys": "formats=file('[foo]\\nreads=\"x\"\\n')",
    "a_key_that_no_format_has": "formats=file(FORMAT.format(name='foo') + 'x=3')",
    "a_wrong_value": "formats=file('[foo]\\nwrite=3\\nfile_name=\"a\"\\nwritten={}')",
    "the_cores_format": "formats=file(FORMAT.format(name='maps'))",
    "anothers_format": "formats=file(FORMAT.format(name='opencv'))",
    "a_text_of_needs": "needs='films'",
    "needs_that_are_not_there": "needs=('films', 'nothing')",
}
MODULES = {
    "not_there": "import nope_nope\n",
    "no_python": "def (\n",
    "exits": "import sys; sys.exit(7)\n",
    "interrupts": "raise KeyboardInterrupt\n",
    "prints": f"print('hello from me')\n{IMPORTED}EXTENSION = Extension()\n",
    "no_extension": "EXTENSION = 3\n",
    "nothing": "",
    **{
        name: f"""from pathlib import Path
{IMPORTED}
HERE = Path(__file__).parent
FORMAT = {FORMAT!r}
def file(text):
    path = HERE / "some.toml"
    path.write_text(text)
    return path
EXTENSION = Extension({record})
"""
        for name, record in RECORDS.items()
    },
}
"""What is found as soon as extensions are loaded."""
COMMANDS = {
    "no_module": "evilmod_nope:x",
    "no_name": "evilcommand:x",
    "no_command": "os:getcwd",
    "that_prints": "evilcommand:printing",
    "that_interrupts": "evilinterrupt:command",
}


def install(folder: Path, module: str, **others: str) -> None:
    """Put a distribution of one extension into a folder, as installers do."""
    about = folder / "evil-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: evil\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[{GROUP}]\nevil = evilext:EXTENSION\n")
    for name, text in {"evilext": module, **others}.items():
        (folder / f"{name}.py").write_text(text)


def forget() -> None:
    """Know nothing of extensions, as a new process does."""
    extension_guard._loaded.cache_clear()
    all_words.cache_clear()
    for name in [name for name in sys.modules if name.startswith("evil")]:
        del sys.modules[name]


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of installed packages; a signal raises what it raises in the program."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    before = signal.signal(signal.SIGINT, start._interrupt)
    forget()
    yield folder
    signal.signal(signal.SIGINT, before)
    forget()


def said(line: list[object], folder: Path) -> tuple[int, str, list[str], list[str]]:
    """Exit code, output, what is said of the extension and what else, of a process of its own."""
    forget()
    done = invoke_cli(*line)
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    told = done.stderr.replace(str(folder), "FOLDER").splitlines()
    own = [text for text in told if "the extension evil" in text]
    rest = [text for text in told if text not in own]
    return done.exit_code, done.stdout.replace(str(folder), "FOLDER"), own, rest


def calibrate_line(folder: Path) -> list[object]:
    corners, target = SAMPLE / "true_corners.csv", SAMPLE / "target.yaml"
    return ["calibrate", corners, "-t", target, "-o", folder, "--overwrite"]


def files_of(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


USUAL: dict[str, Any] = {}
"""What commands say without any extension that is installed, and what they write."""


def check_that_it_is_left_out(site: Path, folder: Path, *, at_once: bool = False) -> None:
    """Compare what is said and written with what is without the extension."""
    lines = [["--help"], ["mine"]]
    if not at_once:
        lines += [calibrate_line(folder), ["target", "check", "-h"]]
    for line in lines:
        code, output, own, rest = said(line, folder)
        assert len(own) <= 1, own
        assert own or not at_once
        assert all("left out" in one and "remove it" in one for one in own)
        wrote = files_of(folder) if line[0] == "calibrate" else set()
        usual = USUAL.setdefault(line[0], without(site, line, folder))
        assert (code, output, rest, wrote) == usual, line
    assert {path.name for path in folder.parent.iterdir()} <= {folder.name, site.name}


def without(site: Path, line: list[object], folder: Path) -> Any:
    """What a command says when nothing is installed, and what it writes."""
    if line[0] in USUAL:
        return None
    there = [*site.iterdir()]
    for path in there:
        path.rename(f"{path}.gone")
    code, output, own, rest = said(line, folder)
    for path in there:
        Path(f"{path}.gone").rename(path)
    assert own == []
    return code, output, rest, files_of(folder) if line[0] == "calibrate" else set()


@pytest.mark.parametrize("name", MODULES)
@pytest.mark.usefixtures("quick_fit")
def test_one_that_is_none_is_named_and_left_out(site: Path, tmp_path: Path, name: str) -> None:
    install(site, MODULES[name])
    check_that_it_is_left_out(site, tmp_path / "cal", at_once=True)


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.usefixtures("quick_fit")
def test_a_command_that_is_none_takes_its_extension_along(
    site: Path, tmp_path: Path, name: str
) -> None:
    # Another command of the same extension, which can be loaded, is not listed either.
    commands = {"well": "cubicfish_cli.commands.info:command", "mine": COMMANDS[name]}
    install(
        site,
        f"{IMPORTED}EXTENSION = Extension(commands={commands!r})\n",
        evilcommand="print('hello')\nfrom cubicfish_cli.commands.info import command as printing\n",
        evilinterrupt="raise KeyboardInterrupt\n",
    )
    check_that_it_is_left_out(site, tmp_path / "cal")


@pytest.mark.parametrize(
    "record",
    [
        "inputs=[Input(among='evilext:fail', photos='evilext:fail')]",
        "inputs=[Input(among='nope_nope:fail', photos='evilext:fail')]",
        "outputs={'mine': Output(file='mine.txt', content='evilext:fail')}",
        "outputs={'mine': Output(file='mine.txt', content='evilext:refuse')}",
        "outputs={'mine': Output(file='mine.txt', content='evilext:NONE')}",
        "words='evilext:NONE'",
        "words='nope_nope:WORDS'",
    ],
)
@pytest.mark.usefixtures("quick_fit")
def test_what_fails_at_work_is_left_out(site: Path, tmp_path: Path, record: str) -> None:
    install(
        site,
        f"{IMPORTED}from cubicfish.errors import FitError\n"
        "def fail(*given): raise ValueError('boom')\n"
        "def refuse(*given): raise FitError('boom')\n"
        f"NONE = 3\nEXTENSION = Extension({record})\n",
    )
    check_that_it_is_left_out(site, tmp_path / "cal")


@pytest.mark.parametrize("name", sorted(path.name for path in SHARED.glob("*/")) or [None])
@pytest.mark.usefixtures("quick_fit")
def test_broken_ones_of_others(site: Path, tmp_path: Path, name: str | None) -> None:
    if name is None:
        pytest.skip("no ../shared here")
    source = (SHARED / name / "evilext.py").read_text()
    install(site, re.sub(r"cubicfish_cli\.app\.extensions\b", IMPORTED.split()[1], source))
    check_that_it_is_left_out(site, tmp_path / "cal")


def test_findings_of_an_extension_have_codes_and_words_of_its_own(site: Path) -> None:
    install(
        site,
        f"""{IMPORTED}
from cubicfish.judge.finding import FindingText
from cubicfish_cli.words.table import Words
WORDS = Words()
@WORDS.finding("evil_moon", "full")
@WORDS.finding("dots")
def moon(board: str, dots: int):
    return FindingText(f"{{board}}: {{dots}} moons", do="wait")
EXTENSION = Extension(words="evilext:WORDS")
""",
    )
    finding = Finding(code="evil_moon", case="full", boards=("wall",), figures={"dots": 2, "x": 1})
    assert render(finding).line == "wall: 2 moons; wait"
    assert record_of(finding)["code"] == "evil_moon"
    # What the program says it goes on saying.
    assert "a grid of about 2 dots" in render(replace(finding, code="dots", case="")).line
    assert str(replace(finding, code="evil_sun")) == render(replace(finding, code="evil_sun")).line


def test_what_needs_one_goes_with_it(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record = f"{IMPORTED}EXTENSION = Extension(needs=['first'], commands={{'mine': 'os:getcwd'}})\n"
    install(site, record, evilfirst=f"{IMPORTED}EXTENSION = Extension()\n")
    points = site / "evil-1.0.dist-info" / "entry_points.txt"
    points.write_text(points.read_text() + "first = evilfirst:EXTENSION\n")
    assert {"evil", "first"} <= {*extensions()}
    (site / "evilfirst.py").write_text("import nope_nope\n")
    for line in (["--help"], ["mine"]):
        forget()
        lines = [text for text in invoke_cli(*line).stderr.splitlines() if "left out" in text]
        assert len(lines) == 2
        assert "extension first (evilfirst:EXTENSION)" in lines[0]
        assert "extension evil (evilext:EXTENSION)" in lines[1]
        assert "needs the extension 'first'" in lines[1]


def test_a_sound_one_adds_what_it_says(site: Path, tmp_path: Path, run: Run) -> None:
    install(
        site,
        f"{IMPORTED}from pathlib import Path\n"
        "EXTENSION = Extension(commands={\n"
        "    'hello': 'cubicfish_cli.commands.info:command',\n"
        "    'rig hello': 'cubicfish_cli.commands.info:command',\n"
        "}, needs=['rigs'], formats=Path(__file__).with_name('formats.toml'))\n",
    )
    (site / "formats.toml").write_text(FORMAT.format(name="foo") + READ)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert "bar" in read_formats()
    assert "\n  hello " in run("--help").stdout
    assert "\n  hello " in run("rig", "--help").stdout
    assert "cubicfish info lens_a/" in run("hello", "--help").stdout
    assert "did you mean 'hello'" in run("helo", code=2).stderr
    # A format that is asked for by its name is no thing to go on without.
    with pytest.raises(CubicfishError, match=r"^the extension evil .* a:b cannot be loaded .*$"):
        read_foreign(tmp_path / "a.txt", name="bar")
    assert "bar" not in read_formats()


def test_a_program_is_warned(site: Path) -> None:
    install(site, MODULES["not_there"])
    with pytest.warns(ExtensionWarning, match="evil .*nope_nope"):
        assert "evil" not in extensions()
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # once is enough
        assert {"films", "rigs"} <= {*extensions()}


def test_debug_shows_where_it_fails(site: Path) -> None:
    install(site, MODULES["not_there"])
    assert "Traceback" not in invoke_cli("mine").stderr
    forget()
    assert "import nope_nope" in invoke_cli("--debug", "mine").stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", ["interrupts", "exits", "prints"])
def test_the_program_itself_goes_on(site: Path, calibrated: Path, name: str) -> None:
    install(site, MODULES[name])

    def ended(*line: str, **more: str) -> Any:
        return subprocess.run(
            [sys.executable, "-m", "cubicfish_cli", *line],
            env={**os.environ, "PYTHONPATH": str(site), **more},
            capture_output=True,
            text=True,
        )

    info = ended("info", str(calibrated))
    assert info.returncode == 0
    assert info.stderr.count("\n") == info.stderr.count("the extension evil ") == 1
    listed = ended("--help")
    assert listed.returncode == 0
    assert listed.stdout.startswith("Usage: cubicfish ")
    assert listed.stderr.count("\n") == listed.stderr.count("the extension evil ") == 1
    completed = ended(_CUBICFISH_COMPLETE="bash_complete", COMP_WORDS="cubicfish ", COMP_CWORD="1")
    assert "calibrate" in completed.stdout
    assert completed.stderr == ""
