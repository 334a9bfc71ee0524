"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.models.formula_lens import FocalLens as FocalLens
from cubicfish.models.formula_lens import FormulaLens as FormulaLens
from cubicfish.models.lens import Lens as Lens
from cubicfish.models.point import PointCamera as PointCamera
from cubicfish.models.radial import RadialCamera as RadialCamera
