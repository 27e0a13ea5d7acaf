"""Plans: which measurements reach a stated uncertainty, and which part what a recording could not."""
