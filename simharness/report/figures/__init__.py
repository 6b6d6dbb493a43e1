"""Drawing shared by pages and tools: SVG figures, overlays, mosaics, colours."""
