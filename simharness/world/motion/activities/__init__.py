"""Activities of one person; ``simharness.world.motion.activity_registry`` explains how to add one."""
