"""Other tools' camera files: what all formats have in common.

Lenses of other tools are the library's `FormulaLens` (`models/formula_lens.py`), whose fields are
their parameters: formats read and write these objects. `file_contents.py` has the records that are
written into files, and checks what is read from them; `foreign_files.py` recognises the format of a
file. The formats are the tables of the extension's formats.toml, their models beside them.
"""
