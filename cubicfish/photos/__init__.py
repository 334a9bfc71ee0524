"""Which photos are meant, and reading them."""
