"""Where things stand: out of everyone's way, in the cameras', by kind, amount and coverage."""
