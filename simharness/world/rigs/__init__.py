"""Camera rigs: layouts, published rigs, lenses, faults and exposure schedules."""
