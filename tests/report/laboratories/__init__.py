"""Documents of interlaboratory comparisons."""
