"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.photos.photos import Photo as Photo
from cubicfish.photos.photos import PictureFile as PictureFile
from cubicfish.photos.photos import expand_pattern as expand_pattern
from cubicfish.photos.photos import find_photos as find_photos
