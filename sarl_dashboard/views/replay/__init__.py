"""The screen Replay."""
