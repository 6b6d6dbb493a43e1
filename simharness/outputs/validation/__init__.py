"""Report of a validation: what simulation predicted, beside what was recorded."""
