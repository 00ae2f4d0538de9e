"""The screen Paper."""
