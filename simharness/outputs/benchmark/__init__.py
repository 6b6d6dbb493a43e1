"""Files of simulated data: sequences in the layout of Panoptic, rendered pictures and films."""
