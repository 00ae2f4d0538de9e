"""What `make bench` measures: the figures of the design, each as a ratio within one run."""
