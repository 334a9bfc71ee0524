"""Shell completion through the program's own entry point: the right words, soon and in silence."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cubicfish_cli.core_table import COMMANDS, commands_of
from cubicfish_cli.extension_guard import extension_commands

HEAVY = {"numpy", "cv2", "scipy", "yaml", "rich", "matplotlib"}
# Lines on stdin; on stdout, between zeros, how each is completed and at the end what was loaded.
PROGRAM = """
import json, os, sys
from contextlib import suppress
from cubicfish_cli.terminal.start import main
for line in json.load(sys.stdin):
    os.environ["COMP_WORDS"] = line
    os.environ["COMP_CWORD"] = str(len(line.split()) - (not line.endswith(" ")))
    with suppress(SystemExit):
        main()
    print(end="\\0", flush=True)
print(*(name.partition(".")[0] for name in sys.modules))
"""


def plain(*words: str) -> list[str]:
    return [f"plain,{word}" for word in words]


EXPECTED = {
    "cubicfish ": plain(*commands_of(COMMANDS, ""), *extension_commands()),
    "cubicfish un": plain("undistort", "unproject"),
    "cubicfish target p": plain("print"),
    "cubicfish undistort --vi": plain("--view"),
    "cubicfish export --to kalibr-o": plain("kalibr-omni"),
    # What stands before is parsed: sizes and crops must not load the libraries that use them.
    "cubicfish undistort a.png b.png --size 80x60 --view c": plain("cylindrical", "cube"),
    "cubicfish calibrate pho": ["file,pho"],
    "cubicfish undistort pho": ["file,pho"],
    "cubicfish undistort photos/ fl": ["file,fl"],
    "cubicfish calibrate photos/ --target ta": ["file,ta"],
    "cubicfish calibrate photos/ --output ca": ["dir,ca"],
    "cubicfish detect photos/ --draw se": ["dir,se"],
    "cubicfish nonsense ": plain(*commands_of(COMMANDS, ""), *extension_commands()),
    "cubicfish nonsense --wo": [],
}
"""Lines that end where the cursor is, and ``kind,word`` for each way to complete them."""


def test_lines_are_completed_in_silence_and_nothing_heavy_is_loaded() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env={**os.environ, "_CUBICFISH_COMPLETE": "bash_complete"},
        input=json.dumps([*EXPECTED]),
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    *found, loaded = (part.split() for part in done.stdout.split("\0"))
    for (line, expected), words in zip(EXPECTED.items(), found, strict=True):
        assert sorted(words) == sorted(expected), line
    assert "click" in loaded
    assert set(loaded) & HEAVY == set()


def test_the_program_completes_a_line() -> None:
    line = {"COMP_WORDS": "cubicfish un", "COMP_CWORD": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "cubicfish_cli"],
        env={**os.environ, **line, "_CUBICFISH_COMPLETE": "bash_complete"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout.split(), done.stderr) == (EXPECTED["cubicfish un"], "")


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """``cubicfish`` on the path, as an installation puts it there."""
    script = tmp_path / "bin" / "cubicfish"
    script.parent.mkdir()
    script.write_text(
        f"#!{sys.executable}\nfrom cubicfish_cli.terminal.start import main\nmain()\n",
        encoding="utf-8",
    )
    script.chmod(0o755)
    monkeypatch.setenv("PATH", str(script.parent), prepend=os.pathsep)
    root = Path(__file__).parents[3]
    monkeypatch.setenv("PYTHONPATH", str(root), prepend=os.pathsep)


def lines_to_paste(shell: str) -> str:
    """What the reference of the command line says to paste into this shell."""
    page = (Path(__file__).parents[3] / "docs" / "cli.md").read_text(encoding="utf-8")
    section = page.partition("## Completion in the shell")[2].partition("\n## ")[0]
    (lines,) = re.findall(rf"In {shell}.*?:\n\n```sh\n(.*?)```", section, re.DOTALL)
    return lines


PROBES = {
    "bash": "COMP_WORDS=(cubicfish tar) COMP_CWORD=1; "
    '"$(complete -p cubicfish | sed "s/.*-F //; s/ .*//")" cubicfish; echo "${COMPREPLY[@]}"',
    "fish": "complete -C 'cubicfish tar' | string split -f1 \\t",
    "zsh": "words=(cubicfish tar) CURRENT=2; compadd() { :; }; "
    '_describe() { local -a found=("${(@P)3}"); print "${found[1]%%:*}"; }; '
    "${_comps[cubicfish]}",
}


@pytest.mark.slow
@pytest.mark.usefixtures("program")
@pytest.mark.parametrize("shell", PROBES)
def test_a_new_shell_completes_after_the_lines_are_pasted(shell: str, tmp_path: Path) -> None:
    """In an account that has nothing: no folders, no settings of the shell."""
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell} here")
    home = tmp_path / "home"
    home.mkdir()
    settings = ("XDG_CONFIG_HOME", "XDG_DATA_HOME", "ZDOTDIR", "BASH_ENV", "ENV")
    environ = {key: value for key, value in os.environ.items() if key not in settings}

    def run(*options: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [shell, *options], env={**environ, "HOME": str(home)}, cwd=home,
            stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60,
        )  # fmt: skip

    pasted = run("-c", lines_to_paste(shell))
    assert (pasted.returncode, pasted.stderr) == (0, "")
    done = run("-i", "-c", PROBES[shell])
    assert done.stdout.split() == ["target"], done.stderr
