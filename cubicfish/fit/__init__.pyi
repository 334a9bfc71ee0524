"""The names that this package offers: `lazy.py` reads them too."""
