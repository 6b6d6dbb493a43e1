"""Drawing shared by reports and tools: SVG plots, overlays on pictures, mosaics and colours."""
