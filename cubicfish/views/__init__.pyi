"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.views.fields import sees as sees
from cubicfish.views.maps import camera_for_photos as camera_for_photos
from cubicfish.views.view import PROJECTIONS as PROJECTIONS
from cubicfish.views.view import CentralView as CentralView
from cubicfish.views.view import PointProjector as PointProjector
