"""Every lens model. A new one is a module beside this one, and a line here."""

from __future__ import annotations

from cubicfish_cli.lenses.division import DivisionLens
from cubicfish_cli.lenses.field_of_view import FieldOfViewLens
from cubicfish_cli.lenses.ftheta import FThetaLens
from cubicfish_cli.lenses.lens import Lens
from cubicfish_cli.lenses.mrcal_splined import SplinedLens
from cubicfish_cli.lenses.pinhole import PinholeLens
from cubicfish_cli.lenses.radial import RadialCamera
from cubicfish_cli.lenses.rational import RationalLens
from cubicfish_cli.lenses.scaramuzza import ScaramuzzaLens
from cubicfish_cli.lenses.thin_prism import RadTanThinPrismLens
from cubicfish_cli.lenses.unified import DoubleSphereLens, UnifiedLens

LENSES: tuple[type[Lens], ...] = (
    RadialCamera,
    DivisionLens,
    FieldOfViewLens,
    ScaramuzzaLens,
    UnifiedLens,
    DoubleSphereLens,
    RationalLens,
    RadTanThinPrismLens,
    FThetaLens,
    SplinedLens,
    PinholeLens,
)
