"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.angles import angle_from_axis as angle_from_axis
from cubicfish.models.formula_lens import FocalLens as FocalLens
from cubicfish.models.formula_lens import FormulaLens as FormulaLens
from cubicfish.models.lens import Lens as Lens
from cubicfish.models.point import PointCamera as PointCamera
from cubicfish.models.radial import RadialCamera as RadialCamera
from cubicfish.models.sphere import cone_rays as cone_rays
