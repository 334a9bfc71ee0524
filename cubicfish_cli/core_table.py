"""What the core calls its commands and a calibration's files: no extension takes these names."""

from collections.abc import Mapping

COMMANDS = {
    "target": "cubicfish_cli.commands.target:command",
    "target check": "cubicfish_cli.commands.target:check",
    "calibrate": "cubicfish_cli.commands.calibrate:command",
    "detect": "cubicfish_cli.commands.detect:command",
    "evaluate": "cubicfish_cli.commands.evaluate:command",
    "compare": "cubicfish_cli.commands.compare:command",
    "info": "cubicfish_cli.commands.info:command",
    "undistort": "cubicfish_cli.commands.undistort:command",
    "map": "cubicfish_cli.commands.map:command",
    "project": "cubicfish_cli.commands.points:project",
    "unproject": "cubicfish_cli.commands.points:unproject",
    "export": "cubicfish_cli.commands.export:command",
    "transform": "cubicfish_cli.commands.transform:command",
}
"""The commands in the order of the work, and where each is; ``target check`` is one of a group."""

CALIBRATION_FILES = {
    "camera": "camera.yaml",
    "map": "undistort_map.npz",
    "target": "target.refined.yaml",
    "corners": "corners.csv",
    "drawn": "target.yaml",
}
"""Names of the files, by content; the camera is removed first and written last."""

FRAMES = "frames"
"""The folder beside them of photos that were chosen from films."""

MAPS = "maps"
"""What ``export`` writes without a format."""


def commands_of(table: Mapping[str, str], group: str) -> dict[str, str]:
    """The commands of a group by their own names, and where each is; "" is no group."""
    split = [(*name.rpartition(" "), place) for name, place in table.items()]
    return {name: place for of, _, name, place in split if of == group}
