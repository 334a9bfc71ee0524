"""``correspondences.csv`` as a program of the user's writes it."""

from pathlib import Path

from cubicfish import Observations


def write_pairs(path: Path, pairs: Observations) -> None:
    width, height = pairs.image_size
    lines = [
        f"# cubicfish correspondences 1, image_size {width}x{height}",
        "image,X,Y,Z,x,y,weight",
    ]
    for image, world, pixel, weight in zip(
        pairs.image, pairs.world, pairs.pixel, pairs.weight, strict=True
    ):
        numbers = (*world.tolist(), *pixel.tolist(), float(weight))
        lines.append(",".join([pairs.images[image], *map(repr, numbers)]))
    path.write_text("\n".join([*lines, ""]))
