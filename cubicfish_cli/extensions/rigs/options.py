"""Options that several commands of rigs share."""

from typing import Any

from cubicfish_cli.terminal.parameters import FILE, Parsed, argument, option

rig_argument: Any = argument(
    "The folder that 'cubicfish rig calibrate' wrote, or its rig.yaml. [default: rig]",
    default="rig",
    metavar="[RIG]",
)

rig_option: Any = option(
    "-m --model RIG",
    "The rig: the folder that 'cubicfish rig calibrate' wrote, or its rig.yaml.",
    FILE,
    "rig",
)

times_option: Any = option(
    "--times FILE",
    "When each photo was taken: a CSV file with the columns camera,image,seconds. What is left "
    "of a camera's lateness is fitted where photos of a shot are not of one moment.",
    FILE,
)


def _read_two_names(text: str) -> tuple[str, str]:
    names = [name.strip() for name in text.split(",")]
    if len(names) != 2 or not all(names) or names[0] == names[1]:
        raise ValueError(f"{text!r} does not name two cameras, such as left,right")
    return names[0], names[1]


pair_option: Any = option(
    "--pair NAME,NAME",
    "Two cameras of the rig, such as left,right. [default: those that it has]",
    Parsed("NAME,NAME", _read_two_names),
)
