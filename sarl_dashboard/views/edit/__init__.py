"""The screen Edit."""
