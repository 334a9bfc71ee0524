"""docs/cli.md is what the commands say, and every command line in help and documents parses."""

import os
import re
import shlex
from dataclasses import fields
from pathlib import Path
from types import ModuleType

import click
import pytest
from command_tree import Words, commands, parse, shell_blocks, uses
from reference import keys_of, load_script
from running import Run

import cubicfish_cli
from cubicfish.judge import FitRecord
from cubicfish.judge.records import key_of

ROOT = Path(__file__).parents[2]
TREE = list(commands())
DOCUMENTS = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])


def name(value: object) -> str:
    if isinstance(value, Path):
        return value.relative_to(ROOT).as_posix()
    return " ".join(value) if isinstance(value, tuple) else "command"


@pytest.fixture(scope="module")
def made() -> ModuleType:
    return load_script()


def sections(text: str) -> dict[str, str]:
    parts = re.split(r"^## (.*)\n", text, flags=re.M)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_the_page_is_current(made: ModuleType) -> None:
    assert made.PAGE.read_text(encoding="utf-8") == made.page(), "run python docs/cli.py"


def test_the_page_depends_on_nothing_here(
    made: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = made.page()
    monkeypatch.setenv("COLUMNS", "30")
    monkeypatch.setenv("LANG", "de_DE.UTF-8")
    monkeypatch.setenv("CUBICFISH_MODEL", "other.yaml")
    monkeypatch.setattr(os, "cpu_count", lambda: 77)
    assert load_script().page() == before


@pytest.mark.parametrize(("words", "command"), TREE[1:], ids=name)
def test_the_page_has_every_command_and_all_its_parameters(
    made: ModuleType, words: Words, command: click.Command
) -> None:
    text = made.PAGE.read_text(encoding="utf-8")
    heading = " ".join(words)
    assert f"- [{heading}](#{'-'.join(words)}): " in text
    section = sections(text)[heading]
    assert f"```text\n{heading} [OPTIONS]" in section
    for param in command.params:
        if isinstance(param, click.Argument):
            assert re.search(rf"^- `{re.escape(made._bare(param))}`: \w", section, re.M)
            continue
        assert isinstance(param, click.Option)
        shown = text if made._is_common(param) else section
        for option in (*param.opts, *param.secondary_opts):
            assert f"`{option}`" in shown or f"`{option} " in shown
        assert param.help, option
        if param.envvar:
            assert f"Environment: `{param.envvar}`." in section
    assert "**Exit codes**" in section
    assert "**Examples**" in section


def test_a_result_that_does_not_say_its_keys_is_named(made: ModuleType) -> None:
    def give() -> "Nothing": ...

    command = click.Command("give")
    vars(command)["do"] = give
    with pytest.raises(SystemExit, match=r"the result of .*give does not say its 'Keys'") as ended:
        made.json_keys(command)
    assert "\n" not in str(ended.value)


class Nothing:
    """A result whose keys nobody knows."""

    def as_record(self) -> dict[str, int]:
        """Return plain data."""
        return {}


def test_keys_are_those_of_the_records_within(made: ModuleType) -> None:
    keys = keys_of("calibrate")
    assert {key_of(one) for one in fields(FitRecord)} < keys.keys()
    assert keys["dropped_corners"].endswith(": image, board, column, row, error_px")
    assert "cause" not in keys["findings"]


def test_links_within_the_page_lead_somewhere(made: ModuleType) -> None:
    text = made.PAGE.read_text(encoding="utf-8")
    places = {heading.lower().replace(" ", "-") for heading in sections(text)}
    links = re.findall(r"\]\(#([^)]*)\)", text)
    assert len(set(links)) > len(TREE)
    assert set(links) <= places


def test_the_page_has_every_variable_that_is_read(made: ModuleType) -> None:
    modules = Path(cubicfish_cli.__file__).parents[1].glob("cubicfish*/**/*.py")
    sources = "\n".join(path.read_text(encoding="utf-8") for path in modules)
    read = set(re.findall(r"environ(?:\.get\(|\.setdefault\(|\[)\s*\"(\w+)\"", sources))
    read |= set(re.findall(r"\"(\w+)\" in os\.environ", sources))
    assert {"CUBICFISH_CACHE", "SOURCE_DATE_EPOCH"} <= read
    reported = sections(made.page())["Environment"]
    assert {variable for variable in read if f"`{variable}`" not in reported} == set()


@pytest.mark.parametrize(("words", "command"), TREE, ids=name)
def test_every_command_has_help_with_examples_of_its_own_that_parse(
    run: Run, made: ModuleType, words: Words, command: click.Command
) -> None:
    said = run(*words[1:], "-h").output
    assert run(*words[1:], "--help").output == said
    lines = made.example_lines(command)
    examples = uses("\n".join(lines))
    assert examples
    assert len(examples) == len(lines), "a line that is no use of cubicfish"
    for line in lines:
        assert line in said
    for args in examples:
        assert parse(args)[: len(words)] == words


@pytest.mark.parametrize("path", DOCUMENTS, ids=name)
def test_command_lines_in_documents_parse(path: Path) -> None:
    for args in uses(shell_blocks(path.read_text(encoding="utf-8"))):
        try:
            parse(args)
        except click.UsageError as error:
            pytest.fail(f"cubicfish {shlex.join(args)}: {error.format_message()}")


@pytest.mark.parametrize(
    "line",
    [
        "cubicfish calibrat photos/",
        "cubicfish calibrate photos/ --tarket target.yaml",
        "cubicfish export --to nowhere",
        "cubicfish target look target.yaml",
        "cubicfish target",
        "ls | cubicfish undistort - flat/ --size wide",
    ],
)
def test_a_wrong_command_line_is_seen(line: str) -> None:
    (args,) = uses(line)
    with pytest.raises(click.UsageError):
        parse(args)


def test_uses_are_found_wherever_they_stand() -> None:
    text = "a && .venv/bin/cubicfish map x.npz # as it is\necho 1,2 | cubicfish unproject\n"
    assert uses(text) == [["map", "x.npz"], ["unproject"]]
    assert shell_blocks(f"cubicfish no\n```sh\n{text}```\n```python\nno\n```\n") == text


def test_the_same_option_has_the_same_words_everywhere() -> None:
    common = {"--target", "--model", "--json", "--overwrite", "--jobs", "--no-cache", "--max-rms"}
    common |= {"--mask", "--scheduler", "--view", "--hfov"}
    words: dict[str, set[str]] = {}
    for path, command in TREE:
        for param in command.params:
            if path[1:2] == ("rig",) and {"--model", "--view", "--hfov"} & {*param.opts}:
                continue  # whose model is no camera, and which has its own kinds of view
            for option in param.opts if isinstance(param, click.Option) else ():
                said = re.split(r" Its keys: ", param.help or "")[0].rstrip(".")
                said = re.sub(r"; of photos also .* in --target", "", said)  # where that is one
                words.setdefault(option, set()).add(f"{param.opts} {param.metavar} {said}")
    assert common <= words.keys()
    assert {
        option: said for option, said in words.items() if option in common and len(said) > 1
    } == {}
