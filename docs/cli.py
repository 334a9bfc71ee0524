"""Make cli.md, the reference of the command line, from the commands themselves.

Run ``python docs/cli.py`` after a command, an option or its help changed; with ``--check`` it
writes nothing, and ends with 1 where cli.md is not what it would write. The page is made from the
parameters, not from click's own help, whose wrapping is another one in each version of click.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from enum import StrEnum
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, get_args, get_type_hints

import click

from cubicfish import Finding
from cubicfish.judge import Code
from cubicfish_cli.terminal.main import cli
from cubicfish_cli.terminal.parameters import Argument

PAGE = Path(__file__).with_name("cli.md")
WIDTH = 100
COMMON = ("--verbose", "--quiet", "--debug")

EXIT_CODES = {
    0: "Done.",
    1: "The work could not be done; one line on stderr, `Error: ...`, says what, where and what "
    "to do.",
    2: "Wrong usage: an option or an argument that there is not, or that does not go with others.",
    3: "Done, all outputs are written, but the RMS is above `--max-rms`.",
    130: "Interrupted by Ctrl-C; 143 by a request to terminate. No file is left half written.",
}

JSON = """\
With `--json` a command prints one object on one line to stdout and nothing else there; what it
says beside its results still goes to stderr, and the exit code is the same. An error leaves stdout
empty; only `undistort`, where some photos failed, prints what was done and what was not, and ends
with 1. Keys that end in `_px` are pixels, those that end in `_deg` degrees; what is not known, or
not finite, is `null`. Keys may be added, so take what you know and leave the rest.

What is told beside figures, whether a finding about a set-up, a reason of a verdict, or a photo or
grid that was refused, is a record with the same keys: `code`, what it is, and `case`, which form of
it; `severity`, `note`, `care` or `bad`; `remedy`, what helps; `what`, `evidence` and `do`, the same
for people; `images` and `boards`, the names that it is about, none for all; `figures`, the numbers
in it. Decide by codes, severities, remedies and figures: sentences may change with any version.
"""

ENVIRONMENT = {
    "CUBICFISH_MODEL": "The camera of every command that takes `--model`, where that is not given.",
    "CUBICFISH_CACHE": "The folder where what was found in photos is kept. [default: "
    "`$XDG_CACHE_HOME/cubicfish`, else `~/.cache/cubicfish`; on macOS and Windows the user's "
    "folder for caches]",
    "XDG_CACHE_HOME": "See `CUBICFISH_CACHE`.",
    "MPLCONFIGDIR": "The folder where matplotlib, which draws boards and advice, keeps its list "
    "of fonts. [default: a folder in that of `CUBICFISH_CACHE`]",
    "SOURCE_DATE_EPOCH": "The time, in seconds since 1970, that files carry as their date, for "
    "files that can be made again to the byte.",
    "OMP_NUM_THREADS": "Threads of linear algebra, as `OPENBLAS_NUM_THREADS` and "
    "`MKL_NUM_THREADS`. [default: 1, since work is shared out by processes]",
    "COLUMNS": "The width of tables on a terminal, where it is not the terminal's own.",
    "NO_COLOR": "Not empty: no colours. `FORCE_COLOR`, not empty: colours also off a terminal.",
    "TERM": "`dumb` or `unknown`: a terminal without colours and moving progress.",
    "OPENCV_IO_MAX_IMAGE_PIXELS": "Larger pictures are refused. [default: 200000000]",
    "OPENCV_LOG_LEVEL": "What OpenCV itself tells on stderr, as `OPENCV_FFMPEG_LOGLEVEL` for what "
    "it reads films with. [default: nothing]",
}

COMPLETION = """\
Shells complete commands, options, choices and paths once they are told to. Paste the lines for your
shell, and open a new one. In bash (4.4 or newer):

```sh
_CUBICFISH_COMPLETE=bash_source cubicfish > ~/.cubicfish.bash
echo '. ~/.cubicfish.bash' >> ~/.bashrc
```

In zsh:

```sh
_CUBICFISH_COMPLETE=zsh_source cubicfish > ~/.cubicfish.zsh
echo 'autoload -Uz compinit && compinit; . ~/.cubicfish.zsh' >> ~/.zshrc
```

In fish:

```sh
mkdir -p ~/.config/fish/completions
_CUBICFISH_COMPLETE=fish_source cubicfish > ~/.config/fish/completions/cubicfish.fish
```
"""

_LONG_CHOICE = "NAME"

# What stands as code in running text: commands in quotes, options, variables.
_CODE = re.compile(
    r"'(?P<quoted>cubicfish [^']+)'|(?P<plain>(?<![\w-])--[a-z][a-z-]*|\$?CUBICFISH_[A-Z]+)"
)
_DEFAULT = re.compile(r"\s*\[default: (.*?)\]\.?$")


def _words(what: str, kind: type[StrEnum]) -> str:
    text = f"{what}: {', '.join(f'`{one.value}`' for one in kind)}."
    return textwrap.fill(text, WIDTH, break_on_hyphens=False) + "\n"


def walk(
    command: click.Command = cli, path: tuple[str, ...] = ("cubicfish",)
) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Every command with its words, a group before its own commands."""
    yield path, command
    if isinstance(command, click.Group):
        context = click.Context(command, info_name=path[-1])
        for name in command.list_commands(context):
            child = command.get_command(context, name)
            assert child is not None
            yield from walk(child, (*path, name))


def example_lines(command: click.Command) -> list[str]:
    """The command lines in a command's epilog."""
    lines = (command.epilog or "").split("Examples:\n")[-1].splitlines()
    return [line.strip() for line in lines if line.strip()]


def json_keys(command: click.Command) -> dict[str, str]:
    """Key -> meaning of what a command prints with ``--json``: what its result's type says.

    That is the section ``Keys`` of its ``as_record``, or of the function that makes it.
    """
    do = vars(command)["do"]
    keys = _keys_in(do)
    if not keys:
        keys = _keys_in(_result_of(do).as_record)
    if not keys:
        sys.exit(f"the result of {do.__qualname__} does not say its 'Keys', which --json prints")
    return keys


def _result_of(do: Callable[..., Any]) -> Any:
    """The type that a function returns, which its module may import for type checkers alone."""
    name, module = do.__annotations__["return"], sys.modules[do.__module__]
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(node, ast.ImportFrom) and name in {one.name for one in node.names}:
            return resolve_name(f"{node.module}.{name}")
    return vars(module)[name]


def _keys_in(thing: Any) -> dict[str, str]:
    """Key -> meaning, as the docstring of a function says."""
    keys: dict[str, str] = {}
    for entry in _entries(thing, "Keys"):
        found = re.fullmatch(r"those of :\w+:`~(.*)`", entry)
        if found is not None:
            other = resolve_name(found[1])
            keys |= _fields_of(other) if isinstance(other, type) else _keys_in(other)
        else:
            names, _, meaning = entry.partition(": ")
            keys |= dict.fromkeys(names.split(", "), meaning)
    return keys


def _fields_of(kind: type) -> dict[str, str]:
    """Key -> meaning of a record that is written field by field, with the fields of records in it.

    Texts are those of the classes' docstrings.
    """
    texts: dict[str, str] = {}
    for one in reversed(kind.__mro__):
        for entry in _entries(one, "Attributes"):
            names, _, meaning = entry.rstrip(".").replace("``", "").partition(": ")
            texts |= dict.fromkeys(names.split(", "), meaning)
    hints = get_type_hints(kind)
    return {
        one.metadata.get("key", one.name): texts[one.name] + _name_inner(hints[one.name])
        for one in fields(kind)
    }


def _name_inner(hint: Any) -> str:
    kinds = [one for one in (hint, *get_args(hint)) if is_dataclass(one)]
    # What is told is the same everywhere.
    names = [one.name for kind in kinds if kind is not Finding for one in fields(kind)]
    return f": {', '.join(names)}" if names else ""


def _entries(thing: Any, section: str) -> list[str]:
    """The entries of a section of a docstring, a line each."""
    text = inspect.cleandoc(thing.__doc__ or "") + "\n"
    found = re.search(rf"^{section}:\n((?: {{4}}.*\n|\n(?= {{4}}))+)", text, re.M)
    lines = textwrap.dedent(found[1]) if found is not None else ""
    return [" ".join(entry.split()) for entry in re.findall(r"^\S.*(?:\n .*)*", lines, re.M)]


def page() -> str:
    """The whole page."""
    commands = list(walk())
    parts = [
        "# The command line\n",
        "<!-- Made by docs/cli.py from the commands: change them, and run it again. -->\n",
        _description(cli),
        "- [Common options](#common-options)\n- [Exit codes](#exit-codes)\n"
        "- [JSON](#json)\n- [Environment](#environment)\n"
        "- [Completion in the shell](#completion-in-the-shell)\n"
        + "".join(_entry(path, command) for path, command in commands[1:]),
        _code(*example_lines(cli)),
        "## Common options\n",
        "Every command has these; all but the help may stand before or after its name.\n",
        _list([_option_words(option) for option in _options(cli) if _is_common(option)] + [_HELP]),
        "`cubicfish -V` or `cubicfish --version` shows the version.\n",
        "## Exit codes\n",
        _list([f"`{code}`: {meaning}" for code, meaning in EXIT_CODES.items()]),
        "Results go to stdout, everything else to stderr, also progress.\n",
        "## JSON\n",
        JSON,
        _words("Codes", Code),
        _words("Remedies", type(Finding(code=Code.UNKNOWN).remedy)),
        "## Environment\n",
        _list([f"`{name}`: {_with_default(text)}" for name, text in ENVIRONMENT.items()]),
        "## Completion in the shell\n",
        COMPLETION,
    ]
    for path, command in commands[1:]:
        parts += _command(path, command)
    return "\n".join(parts)


_HELP = "`-h`, `--help`: Show the command's help and exit."


def _command(path: tuple[str, ...], command: click.Command) -> list[str]:
    """The sections of one command."""
    synopsis = f"```text\n{_synopsis(path, command)}\n```\n"
    parts = [f"## {' '.join(path)}\n", synopsis, _description(command)]
    if isinstance(command, click.Group):
        children = [(words, child) for words, child in walk(command, path) if child is not command]
        parts += ["**Commands**\n", "".join(_entry(*child, top=len(path)) for child in children)]
    arguments = [param for param in command.params if isinstance(param, click.Argument)]
    if arguments:
        parts += ["**Arguments**\n", _list([_argument_words(argument) for argument in arguments])]
    options = [option for option in _options(command) if not _is_common(option)]
    if options:
        parts += ["**Options**\n", _list([_option_words(option) for option in options])]
    parts.append("And the [common options](#common-options).\n")
    if _has(command, "--json"):
        keys = json_keys(command)
        parts += [
            "**JSON**\n",
            "The keys of what `--json` prints, [as everywhere](#json):\n",
            _list([f"`{key}`: {_text(meaning)}" for key, meaning in keys.items()]),
        ]
    parts += ["**Examples**\n", _code(*example_lines(command))]
    codes = [code for code in EXIT_CODES if code != 3 or _has(command, "--max-rms")]
    if isinstance(command, click.Group):
        codes = [0, 2]
    shown = ", ".join(f"`{code}`" for code in codes)
    parts.append(f"**Exit codes**: {shown}, as [above](#exit-codes).\n")
    return parts


def _entry(path: tuple[str, ...], command: click.Command, *, top: int = 1) -> str:
    """A line of a table of contents, for a command below one of ``top`` words."""
    name = " ".join(path)
    indent = "  " * (len(path) - top - 1)
    return f"{indent}- [{name}](#{name.replace(' ', '-')}): {_text(command.short_help or '')}\n"


def _synopsis(path: tuple[str, ...], command: click.Command) -> str:
    words = [*path, "[OPTIONS]"]
    if isinstance(command, click.Group):
        words += ["COMMAND", "[ARGS]..."]
    words += [_metavar(param) for param in command.params if isinstance(param, click.Argument)]
    return " ".join(words)


def _description(command: click.Command) -> str:
    """The help text, paragraph by paragraph; what stands as it is becomes a block of code."""
    paragraphs = []
    for paragraph in re.split(r"\n\s*\n", (command.help or "").strip()):
        kept = paragraph.removeprefix("\b\n")
        if kept != paragraph:
            paragraphs.append("```text\n" + textwrap.dedent(kept).rstrip() + "\n```\n")
        else:
            paragraphs.append(_wrapped(_text(" ".join(paragraph.split()))) + "\n")
    return "\n".join(paragraphs)


def _options(command: click.Command) -> list[click.Option]:
    return [
        param for param in command.params if isinstance(param, click.Option) and not param.hidden
    ]


def _is_common(option: click.Option) -> bool:
    return any(name in COMMON for name in option.opts)


def _has(command: click.Command, name: str) -> bool:
    return any(name in option.opts for option in _options(command))


def _metavar(param: click.Parameter) -> str:
    """What stands for a parameter's value; empty for a flag."""
    if isinstance(param, click.Option) and (param.is_flag or param.count):
        return ""
    if param.metavar:
        return param.metavar
    if isinstance(param, click.Argument):
        name = (param.name or "").upper()
        return name if param.required else f"[{name}]"
    if isinstance(param.type, click.Choice):
        choices = "|".join(str(choice) for choice in param.type.choices)
        return choices if len(choices) < WIDTH - 20 else _LONG_CHOICE
    return param.type.name


def _argument_words(argument: click.Argument) -> str:
    meaning = argument.meaning if isinstance(argument, Argument) else ""
    return f"`{_bare(argument)}`: {_with_default(_text(meaning))}"


def _bare(argument: click.Argument) -> str:
    """An argument's name without the brackets that say it may be left out."""
    name = _metavar(argument)
    return name.removeprefix("[").replace("]", "") if name.startswith("[") else name


def _option_words(option: click.Option) -> str:
    """An option's names, its help, and what values it takes."""
    names = ", ".join(f"`{name}`" for name in option.opts)
    if option.secondary_opts:
        names += " or " + ", ".join(f"`{name}`" for name in option.secondary_opts)
    metavar = _metavar(option)
    if metavar:
        names = f"{names[:-1]} {metavar}`"
    text = option.help or ""
    if option.show_default is True and "[default: " not in text:
        text = f"{text} [default: {_default(option)}]"
    words = [_with_default(_text(text)), _range(option)]
    if option.required:
        words.append("Required.")
    if option.envvar:
        words.append(f"Environment: `{option.envvar}`.")
    return " ".join([f"{names}:", *(word for word in words if word)])


def _default(option: click.Option) -> str:
    if option.secondary_opts:
        return (option.opts if option.default else option.secondary_opts)[-1]
    return str(option.default)


def _with_default(text: str) -> str:
    """``[default: x]`` at the end of a text as a sentence of its own."""
    found = _DEFAULT.search(text)
    if found is None:
        return text
    default = found[1] if " " in found[1] or "`" in found[1] else f"`{found[1]}`"
    return f"{text[: found.start()]} Default: {default}."


def _range(option: click.Option) -> str:
    """The numbers that an option takes, or its choices where nothing else tells them."""
    kind = option.type
    if isinstance(kind, click.Choice):
        told_of = f"{_metavar(option)} {option.help}"
        if all(choice in told_of for choice in kind.choices):
            return ""
        return f"One of {', '.join(f'`{choice}`' for choice in kind.choices)}."
    told = option.metavar is not None and option.metavar[0].isdigit()
    if told or not isinstance(kind, click.IntRange | click.FloatRange):
        return ""
    low = "" if kind.min is None else f"{'above' if kind.min_open else 'from'} {_plain(kind.min)}"
    high = "" if kind.max is None else f"{'below' if kind.max_open else 'to'} {_plain(kind.max)}"
    if low and not high:
        low = low.replace("from", "at least")
    words = " ".join(part for part in (low, high) if part)
    return f"{words[:1].upper()}{words[1:]}." if words else ""


def _plain(number: float) -> str:
    return f"{int(number):,}" if number == int(number) else f"{number:g}"


def _text(text: str) -> str:
    """Plain text as Markdown: what has a meaning there is escaped, commands are code."""
    done, at = "", 0
    for found in _CODE.finditer(text):
        done += _escaped(text[at : found.start()]) + f"`{found['quoted'] or found['plain']}`"
        at = found.end()
    return done + _escaped(text[at:])


def _escaped(text: str) -> str:
    return re.sub(r"([\\`*<>~$]|(?<!\w)_|_(?!\w))", r"\\\1", text)


def _wrapped(text: str, indent: str = "") -> str:
    """Lines of the page's width; none ends within code."""
    joined = re.sub(r"`[^`]*`", lambda code: code[0].replace(" ", "\0"), text)
    lines = textwrap.fill(
        joined, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )
    return lines.replace("\0", " ")


def _list(items: list[str]) -> str:
    return "".join(_wrapped(f"- {item}", "  ") + "\n" for item in items)


def _code(*lines: str) -> str:
    return "```sh\n" + "\n".join(lines) + "\n```\n"


def main() -> None:
    """Write the page, or with ``--check`` see whether it is current."""
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(f"usage: python {sys.argv[0]} [--check]")
    text = page()
    if sys.argv[1:] == []:
        PAGE.write_text(text, encoding="utf-8", newline="\n")
    elif not PAGE.exists() or PAGE.read_text(encoding="utf-8") != text:
        sys.exit(f"{PAGE} is not current: run python docs/cli.py")


if __name__ == "__main__":
    main()
