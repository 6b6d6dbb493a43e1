"""Tables 1 and 2 of the paper (Dong et al., CVPR 2019): printed, on real data, on simulated twins."""
