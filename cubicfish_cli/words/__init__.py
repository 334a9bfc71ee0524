"""What is told: codes and figures, and the one home of the sentences that are made of them."""
