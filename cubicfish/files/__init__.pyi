"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.files.fingerprint import Fingerprint as Fingerprint
from cubicfish.files.frame_names import FrameName as FrameName
from cubicfish.files.plain_yaml import parse_plain_yaml as parse_plain_yaml
from cubicfish.files.reading import read_bytes as read_bytes
from cubicfish.files.reading import read_text as read_text
from cubicfish.files.tables import Table as Table
from cubicfish.files.whole_files import Content as Content
from cubicfish.files.whole_files import StrPath as StrPath
from cubicfish.files.whole_files import refuse_existing as refuse_existing
from cubicfish.files.whole_files import write_files as write_files
