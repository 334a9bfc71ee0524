"""Other lens models, fitted like the cubic one to stand beside it in figures."""
