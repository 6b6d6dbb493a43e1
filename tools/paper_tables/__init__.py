"""Tables 1 and 2 of the paper (Dong et al., CVPR 2019): as printed, on real data, and on simulated twins."""
