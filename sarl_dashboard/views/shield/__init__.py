"""The screen Shield."""
