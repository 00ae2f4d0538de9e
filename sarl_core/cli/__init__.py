"""What the commands share: options, errors, progress, and how answers are told."""
