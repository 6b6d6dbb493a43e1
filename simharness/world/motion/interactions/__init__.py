"""Activities of two people; ``simharness.world.motion.activity_registry`` explains how to add one."""
