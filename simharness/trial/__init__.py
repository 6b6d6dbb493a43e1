"""One trial: a scenario at a seed built, captured, detected, estimated, audited and scored."""
