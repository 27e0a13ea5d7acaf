"""Examples that come with the package: a real recording, and plans for the virtual machine."""
