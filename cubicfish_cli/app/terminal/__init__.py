"""The command line. Nothing else imports it.

`app/terminal/main.py` holds the group. A command's module is imported when the command is named,
and it imports numpy, OpenCV and the rest inside its body, so that help and usage errors answer at
once; `tests/commands/test_main.py` holds that. A module of `commands/` is a command: the record of
its options (`record` in `options.py`), the function that takes it and gives one result, and what is
printed of that. Each option is a field, written once with its type, its default and its help, and a
field may be made of several options (`bundle`). The function is public, and programs call it with a
record of their own. How it works and answers (`--jobs`, `--json` and the like) is a second record,
`How` in `progress.py`, of which a command names the fields that it has. `progress.py` also has the
`Listener` that shows a line of progress and says what is told, and `running`, which makes the `Run`
(jobs, cache, overwriting, listener) that functions take whole. What says nothing in a mode is
refused, by the record itself or, where files tell the mode, by the function: no option is passed
over, and `tests/commands/test_options.py` holds a table of them. The commands that are still in
`app/terminal/` call functions of `app/`: `undistort` and `map` with their record whole, the others
by `call`, whose fields are the function's parameters of the same names. What commands share has one
home each: options of many commands, and numbers with bounds, in `options.py`; words and tables on
stdout and stderr in `terminal.py`, figures and the table of photos in `figures.py`, the widths and
colours of the streams in `streams.py`. What does not go together is a `UsageError` of the library,
which ends with 2. Names of outputs are refused by `refuse_existing` before the work, and all
outputs of a run are written by one `write_files` (`files.py`), which takes texts, bytes and writers
by path. `app/inputs.py` turns photos or CSV files into pairs, and `commands/calibrate.py` these
into a fit and the files of its folder: `camera.yaml` becomes final last: where it is, the others
are its own, whenever a run is killed. `tests/system/faults/try_faults.py` kills every command at
random moments and spoils its folders. What stays from one run to the next is below one folder,
`cache_folder` of `app/terminal/progress.py`. `tests/system/packaging` runs chains of commands
without a network, with every warning an error, and compares all files before and after;
`try_packages.py` there builds and installs the distributions.
"""
