"""Recorded data in the field's formats, read into the types of mvpose, and scored."""
