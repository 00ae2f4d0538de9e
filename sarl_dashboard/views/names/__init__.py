"""The screen Names."""
