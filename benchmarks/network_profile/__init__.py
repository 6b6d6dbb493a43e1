"""A fitted profile beside its network on scenes that the fit has not seen."""
