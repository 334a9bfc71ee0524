"""What is likely wrong with a set-up, told from its corners: hypotheses, tested by cheap fits."""
