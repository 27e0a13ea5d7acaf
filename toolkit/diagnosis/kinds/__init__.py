"""The kinds of simulation that a case may declare, one a file, all of the shape of `model.Model`."""
