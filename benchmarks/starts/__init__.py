"""Starts of cameras that ``mvpose estimate --sync`` finds in simulated recordings, beside the true ones."""
