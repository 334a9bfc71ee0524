"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.photos.photos import Photo as Photo
from cubicfish.photos.photos import Picture as Picture
from cubicfish.photos.photos import find_photos as find_photos
from cubicfish.photos.photos import read_grey as read_grey
