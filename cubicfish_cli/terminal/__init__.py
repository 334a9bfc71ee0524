"""The command line. Commands import it, and nothing else does.

`start.py` is where the program begins: it settles signals and streams, then runs the group of
`main.py`, which imports a command's module when the command is named. The module imports numpy,
OpenCV and the rest inside its functions, so that help and usage errors answer at once;
`tests/cubicfish_cli/commands/test_main.py` holds that.

A module of `commands/` is one command: the record of its options (`record` in `parameters.py`), the
public function that takes the record and a `Run` and returns one result, and the function that
prints the result. `as_command` makes click's command of the three. Each option is a field of the
record, written once with its type, its default and its help; several options may make one field
(`bundle`). How a command works and answers (`--jobs`, `--json` and the like) is a second record,
`How` in `progress.py`, of which a command names the fields that it has; `How.run` makes the `Run`
(jobs, cache, overwriting, listener). The record itself refuses an option that says nothing in a
mode, or the function does where files tell the mode;
`tests/cubicfish_cli/commands/test_options.py` holds a table of all options. What does not go
together is a `UsageError` of the library, and the exit code is 2.

What commands share: options of many commands, and numbers with bounds, in `parameters.py`; lines
and tables on stdout and stderr in `terminal.py`; figures and the table of photos in `figures.py`;
the line of progress, and the folder of what is kept from one run to the next, in `progress.py`.

A `Plan` (`plan.py`) knows what a run reads and writes, and refuses outputs before the work: those
that exist, that are inputs, or that have one name. One `write_files` (`files/whole_files.py`)
writes all outputs of a run. In a calibration's folder `camera.yaml` comes last: where it is, the
others are its own, whenever a run is killed. `tests/system/faults/try_faults.py` kills every
command at random moments and spoils its folders. `tests/system/packaging` runs chains of commands
without a network, with every warning an error, and compares all files before and after;
`try_packages.py` there builds and installs the distribution.
"""
