"""The page Episodes."""
