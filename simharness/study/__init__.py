"""Many runs in one: sweeps over factors and seeds, trials that are kept, tables of them all."""
