"""Who chooses actions: novices, policies of a network, files of Stable-Baselines3."""
