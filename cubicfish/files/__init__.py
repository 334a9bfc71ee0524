"""Files that nobody vouches for, and files that appear whole or not at all.

`reading.py` bounds what is read, `plain_yaml.py` and `tables.py` parse it and name the line of an
error, `whole_files.py` writes. `fingerprint.py` has the hashes of what was read, and
`frame_names.py` says what frames of films are called.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
