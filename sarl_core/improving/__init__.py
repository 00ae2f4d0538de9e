"""Rule sets that are mined again, where they failed."""
