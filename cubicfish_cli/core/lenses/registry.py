"""Every lens model. A new one is a module beside this one, and a line here."""

from __future__ import annotations

from cubicfish_cli.core.lenses.division import DivisionLens
from cubicfish_cli.core.lenses.field_of_view import FieldOfViewLens
from cubicfish_cli.core.lenses.ftheta import FThetaLens
from cubicfish_cli.core.lenses.lens import Lens
from cubicfish_cli.core.lenses.mrcal_splined import SplinedLens
from cubicfish_cli.core.lenses.pinhole import PinholeLens
from cubicfish_cli.core.lenses.radial import RadialCamera
from cubicfish_cli.core.lenses.scaramuzza import ScaramuzzaLens
from cubicfish_cli.core.lenses.thin_prism import RadTanThinPrismLens
from cubicfish_cli.core.lenses.unified import DoubleSphereLens, UnifiedLens

LENSES: tuple[type[Lens], ...] = (
    RadialCamera,
    DivisionLens,
    FieldOfViewLens,
    ScaramuzzaLens,
    UnifiedLens,
    DoubleSphereLens,
    RadTanThinPrismLens,
    FThetaLens,
    SplinedLens,
    PinholeLens,
)
