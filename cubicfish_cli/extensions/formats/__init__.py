"""Other tools' files: cameras, and corners that other detectors found.

A format is a module and a table in formats.toml; `app/lenses/` has what all share, and finds lens
and format. `lenses.py` has the models that several formats hold, a format's module one that it
alone knows. `import_camera.py` and `corners.py` are commands, `importing.py` the functions for
programs; `vnlog.py` reads corners. `export`, in `commands/export.py`, writes the formats that the
table has.
"""
