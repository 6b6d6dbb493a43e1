"""Real error of estimates beside the one that their covariances lead one to expect."""
