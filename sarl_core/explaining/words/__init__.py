"""Rules, evidence and results in sentences."""
