"""Types passed between the packages of simharness, and the keyed random streams that all of them draw from."""
