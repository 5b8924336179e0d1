"""What the vehicle tells ground control: messages from the state that the control loop sees."""
