"""What hangs below: gripper, winch, and the delivery of a load."""
