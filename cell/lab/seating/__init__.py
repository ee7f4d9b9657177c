"""Study of seating by force against depth in a hole without a switch: true seatings, and parts mistaken for seated."""
