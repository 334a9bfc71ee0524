"""The commands as a tree, and command lines as they are parsed, for tests of help and documents."""

import re
import shlex
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import click

from cubicfish_cli.terminal.main import cli

Words = tuple[str, ...]


def commands(
    command: click.Command = cli, words: Words = ("cubicfish",)
) -> Iterator[tuple[Words, click.Command]]:
    """Every command and group with the words that call it."""
    yield words, command
    if isinstance(command, click.Group):
        for name in command.list_commands(click.Context(command)):
            child = command.get_command(click.Context(command), name)
            assert child is not None
            yield from commands(child, (*words, name))


def parse(args: list[str]) -> Words:
    """Parse a command line without doing anything; return the words of its command.

    Raises:
        click.UsageError: there is no such command, option or choice.

    """
    command: click.Command = cli
    context = click.Context(cli, info_name="cubicfish", **cli.context_settings)
    words: Words = ("cubicfish",)
    while isinstance(command, click.Group):
        if not args:
            raise click.UsageError("no command")
        name, command, args = command.resolve_command(context, args)  # type: ignore[assignment]
        words = (*words, name)
        context = click.Context(command, info_name=name, parent=context)
    with suppress(click.exceptions.Exit):  # -h
        command.make_context(words[-1], list(args), parent=context.parent)
    return words


def uses(text: str) -> list[list[str]]:
    """The arguments of every use of cubicfish in shell text."""
    found = []
    for line in text.replace("\\\n", " ").splitlines():
        for part in re.split(r"&&|\||;|\$\(", line):
            try:
                words = shlex.split(part, comments=True)
            except ValueError:  # half of a quoted text
                continue
            if words and Path(words[0]).name == "cubicfish":
                found.append(words[1:])
    return found


def shell_blocks(markdown: str) -> str:
    """What stands in a document's blocks of shell code."""
    return "\n".join(re.findall(r"^```(?:sh|bash|console)\n(.*?)^```$", markdown, re.S | re.M))
