"""From the ground into the air and back, step by step."""
