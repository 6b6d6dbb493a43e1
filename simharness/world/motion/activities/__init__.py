"""Activities of one person; ``simharness.world.motion.registry`` explains how to add one."""
