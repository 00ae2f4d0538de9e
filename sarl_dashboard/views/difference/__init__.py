"""The screen Difference."""
