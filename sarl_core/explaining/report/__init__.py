"""The report of a rule set, one HTML file."""
