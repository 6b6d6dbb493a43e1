"""Report of a study: curves, breaking points, failures and worst frames."""
