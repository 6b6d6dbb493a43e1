"""Studies: sweeps over factors and seeds, a store of finished trials, and tables of their results."""
