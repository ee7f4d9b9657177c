"""What force against depth tells of a part in a hole without a switch: seatings, and what may be taken for one."""
