"""What the method and the simulator cost; never imported by the packages."""
