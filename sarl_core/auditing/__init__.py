"""Rules held against a log of what somebody did, with no environment."""
