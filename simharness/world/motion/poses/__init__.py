"""One body and its limbs: forward and inverse kinematics, feet on the floor, the timing of what is done."""
