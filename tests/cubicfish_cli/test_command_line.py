"""The command that a camera's file keeps can be given to a shell again."""

import click
from click.testing import CliRunner

from cubicfish_cli.terminal.parameters import command_line


def test_an_option_that_was_given_twice_is_kept_twice() -> None:
    @click.command("fit")
    @click.argument("photos", nargs=-1)
    @click.option("--lens", multiple=True)
    @click.option("--board", nargs=2, type=int)
    @click.option("--hold-out/--no-hold-out", default=True)
    @click.option("--title")
    def fit(**given: object) -> None:
        click.echo(command_line())

    args = ["a b", "--lens", "l=1", "--lens", "r=2", "--board", "9", "6", "--no-hold-out"]
    kept = CliRunner().invoke(fit, args, prog_name="fit").output.strip()
    assert kept == "fit 'a b' --lens l=1 --lens r=2 --board 9x6 --no-hold-out"
