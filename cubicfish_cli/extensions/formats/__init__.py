"""Other tools' files: cameras, and corners that other detectors found.

A format is a module and a table in formats.toml; `foreign/` has what all share, and recognises
formats. `camera_keys.py` has those that are only read, of lenses that are known under other keys.
`lenses.py` has the models that several formats hold; a model of one format stands in that format's
module. `import_camera.py` and `corners.py` are commands, `importing.py` has the functions for
programs; `corner_files.py` reads corners. `export`, in `commands/export.py`, writes the formats of
the table.
"""
