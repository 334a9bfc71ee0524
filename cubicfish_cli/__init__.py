"""The program ``cubicfish``, written against the library of that name.

What a command does is a function that takes a record of its options, from files to files::

    from cubicfish_cli import DetectOptions, detect_files

    found = detect_files(DetectOptions(photos="photos/", target="target.yaml"))

These functions are described in docs/library.md. The main names of the library may be imported
from here too. All names are loaded when they are first used, so that importing the package loads
nothing else. Nothing here prints, and files are written by ``choose_frames`` and what is called
``..._files``, ``save`` or ``save_...`` alone.

Conventions are those at the top of ``cubicfish/__init__.py``.
"""

__version__ = "0.1.0"

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__, checked=True)
