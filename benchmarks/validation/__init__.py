"""Power of a validation: which wrong twins it notices."""
