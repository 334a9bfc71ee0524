"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.observe.glances import Glances as Glances
