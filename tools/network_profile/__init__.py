"""How a network errs in rendered pictures, and the detector profile with which simulation errs alike."""
