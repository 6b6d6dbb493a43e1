"""Extrinsics that ``mvpose calibrate`` finds from people of simulated recordings, beside the true ones and a peer's."""
