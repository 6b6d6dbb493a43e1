"""Types that cross borders between packages, and the keyed random streams that all of them draw from."""
