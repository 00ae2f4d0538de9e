"""The screen Rules."""
