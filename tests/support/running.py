"""Running the command line in this process."""

from collections.abc import Callable
from inspect import signature

from click.testing import CliRunner, Result

from cubicfish_cli.render import drawing as extra
from cubicfish_cli.terminal.main import cli

Run = Callable[..., Result]


def invoke_cli(*args: object, input: str | None = None) -> Result:
    """Run the command line in this process, whatever its exit code."""
    # Before click 8.2 stderr is kept apart only when asked for, and since then it always is.
    apart = {"mix_stderr": False} if "mix_stderr" in signature(CliRunner).parameters else {}
    return CliRunner(**apart).invoke(
        cli, [str(arg) for arg in args], input=input, prog_name="cubicfish"
    )


def run_cli(*args: object, input: str | None = None, code: int = 0) -> Result:
    """Run the command line in this process and check its exit code."""
    result = invoke_cli(*args, input=input)
    assert result.exit_code == code, (result.output, result.stderr, result.exception)
    return result


MISSING = extra.missing
"""What tells which libraries of a report are absent; tests go on as if all were."""
