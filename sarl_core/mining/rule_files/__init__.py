"""The rule file: JSON, thresholds at full precision."""
