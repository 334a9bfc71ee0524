"""Groups of commands, each of which is imported when it is named."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import click

from cubicfish_cli.app.extensions import load_place
from cubicfish_cli.core.wording import did_you_mean


class LazyGroup(click.Group):
    """Commands by name, each in its module, which is imported when the command is asked for.

    Args:
        own: name -> ``module:command``.
        more: gives further ones, where none of these is meant.

    """

    def __init__(
        self,
        *args: Any,
        own: Mapping[str, str],
        more: Callable[[], Mapping[str, str]] = dict,
        **rest: Any,
    ) -> None:
        super().__init__(*args, **rest)
        self._own, self._more = own, more

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands' names, in the order of the work."""
        return [*self._own, *self._more()]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the command's module and return the command."""
        place = self._own.get(cmd_name) or self._more().get(cmd_name)
        command: click.Command | None = None if place is None else load_place(place)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, with the nearest command when there is none of that name."""
        named = args and not args[0].startswith("-") and not ctx.resilient_parsing
        if named and args[0] not in self._own:  # a shell that completes a line is told nothing
            known = self.list_commands(ctx)
            if args[0] not in known:
                ctx.fail(f"No such command {args[0]!r}: {did_you_mean(args[0], known)}")
        return super().resolve_command(ctx, args)
