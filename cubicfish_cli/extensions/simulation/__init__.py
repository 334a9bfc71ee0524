"""Target and lens -> photos with known truth."""
