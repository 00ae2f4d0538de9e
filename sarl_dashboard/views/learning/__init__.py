"""The screen Learning."""
