"""The screen Thresholds."""
