"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.fit.exported_lens import Conversion as Conversion
from cubicfish.fit.exported_lens import to_lens as to_lens
from cubicfish.fit.imported_lens import ImportedCamera as ImportedCamera
from cubicfish.fit.imported_lens import from_lens as from_lens
from cubicfish.fit.model_selection import RefineTarget as RefineTarget
from cubicfish.fit.point_fit import PointCalibration as PointCalibration
from cubicfish.fit.point_fit import calibrate_points as calibrate_points
