"""Report of one run: page, plots, pictures and film."""
