"""The screen Improve."""
