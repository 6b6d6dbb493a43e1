"""Trials: a scenario at a seed is built, captured, audited, detected, estimated and scored."""
