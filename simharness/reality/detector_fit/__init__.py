"""A real detector measured against ground truth, and the profile that makes the simulated one err as it does."""
