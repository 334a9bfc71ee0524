"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.views.bands import MapInBands as MapInBands
from cubicfish.views.choose import ChosenView as ChosenView
from cubicfish.views.choose import choose_view as choose_view
from cubicfish.views.options import Interpolation as Interpolation
from cubicfish.views.options import ViewOptions as ViewOptions
from cubicfish.views.view import CentralView as CentralView
