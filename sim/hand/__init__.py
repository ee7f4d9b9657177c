"""The simulated hand: pads, skin, grip, switch and gripper."""
