"""Studies: the virtual machine, and why a simulation differs from a recording."""
