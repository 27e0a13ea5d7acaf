"""The virtual machine: tire, road, carriage, load cells, data acquisition, walked forward."""
