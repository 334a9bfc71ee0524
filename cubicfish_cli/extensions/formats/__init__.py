"""Other tools' files: cameras, and corners that other detectors found.

A format is a module and a table in formats.toml; `foreign/` has what all share, and recognises
formats. `lenses.py` has the models that several formats hold; a model of one format stands in that
format's module. `import_camera.py` and `corners.py` are commands, `importing.py` has the functions
for programs; `vnlog.py` reads corners. `export`, in `commands/export.py`, writes the formats of the
table.
"""
