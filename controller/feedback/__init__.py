"""What the law flies on: the plant's truth or the estimate, and how far it can be trusted."""
