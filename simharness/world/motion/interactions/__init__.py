"""Activities of two people; ``simharness.world.motion.registry`` explains how to add one."""
