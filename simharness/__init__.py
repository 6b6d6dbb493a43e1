"""Simulated people before simulated cameras, the truth about every joint, and scores of the method under test."""
