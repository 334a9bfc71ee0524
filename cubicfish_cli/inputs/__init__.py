"""What a caller names: paths, targets, photos or tables, a calibration's folder."""
